"""Replay of a recorded run with comparison of the decisions, and resumption of an interrupted run."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from pydantic import JsonValue

from executive import events
from executive.behaviours import Skills
from executive.errors import InputError, escape_control_characters, shorten_quotations
from executive.events import MotionPlanned, NodeEnded, NodeStarted, RequestGiven, RunStarted, TimedEvent
from executive.mission.load import LoadedMission
from executive.record.journal import Recorder, find_run_end, find_run_start, read_journal
from executive.record.recorded_run import RecordOptions, execute_recorded
from executive.record.result import Result, is_resumable, read_result
from executive.record.run_directory import RunDirectory, find_recorded_options, read_mission_of_run
from executive.record.timeline import get_skill_name
from executive.run.assembly import RunOptions
from executive.run.replay import InputLog, ResumedRun, assemble_replay, assemble_resumed
from executive.text.files import read_source

EVENTS_WITHOUT_REPLAY = (RunStarted, MotionPlanned, RequestGiven)
"""Kinds of events that a replay does not emit."""


@dataclass
class ReplayResult:
    """Result of a replay.

    Attributes:
        decisions: Number of equal decisions.
        ticks: Number of control steps of the replay.
        recorded, replayed: First differing decision of record and replay, without message, or None.
        edited: True if the replayed mission differs from the recorded mission.
        unanswered: Message about the input whose missing value ended the replay, or "".
        is_complete: True if the replay repeated all recorded control steps.
    """

    decisions: int = 0
    ticks: int = 0
    recorded: TimedEvent | None = None
    replayed: TimedEvent | None = None
    edited: bool = False
    unanswered: str = ""
    is_complete: bool = True

    @property
    def is_equal(self) -> bool:
        """True if all decisions are equal."""
        return self.recorded is None and self.replayed is None

    @property
    def difference(self) -> str:
        """Message about the first difference, or ""."""
        if self.is_equal:
            return ""
        text = f"recorded: {_describe_decision(self.recorded)}; replayed: {_describe_decision(self.replayed)}"
        if not self.unanswered:
            return text
        return f"{text}: {self.unanswered}; only a new run can show the consequences of this difference"

    def as_json(self) -> dict[str, JsonValue]:
        """Return the attributes as JSON; the entry of a decision has its tick, clock, kind and fields."""
        return vars(self) | {"recorded": _to_json(self.recorded), "replayed": _to_json(self.replayed)}


def replay_run(
    path: Path, journal: Iterable[TimedEvent], skills: Skills, mission: Path | None = None
) -> ReplayResult:
    """Replay a recorded run with the installed skills, and compare its decisions with the journal.

    All inputs come from the journal. The replay ends at the first difference.

    Args:
        path: The run directory.
        journal: Events of the journal.
        skills: Installed skills by name.
        mission: Mission file that replaces the recorded mission, or None. If the missions differ, only
            the decisions of skills and the states of items are compared.

    Raises:
        InputError: The directory contains no run that can be replayed.
    """
    log = InputLog(journal)
    start = log.start_event
    if start is None or not log.inputs:
        raise InputError(f'"{path}" contains no run that can be replayed: its journal has no inputs of a run')
    loaded = read_mission_of_run(path, start, skills, mission)
    edited = mission is not None and loaded.text != read_source(path / "mission.yaml").text
    return replay_and_compare(loaded, log, start.seed, edited=edited)


def replay_and_compare(loaded: LoadedMission, log: InputLog, seed: int, edited: bool = False) -> ReplayResult:
    """Replay a log with a mission, and compare the decisions with the log."""
    comparison = _Comparison(log, edited)
    run = assemble_replay(loaded, log, seed, observers=[comparison])
    comparison.run = run
    run.execute()
    comparison.compare_end()
    comparison.result.ticks = run.tick
    return comparison.result


class _Comparison:
    """Observer that compares the decisions of a replay with the recorded decisions.

    Attributes:
        result: Result of the replay up to now, without the number of its control steps.
        run: Run of the replay; the comparison stops it at the first difference.
    """

    run: ResumedRun

    def __init__(self, log: InputLog, edited: bool) -> None:
        self._log = log
        self.result = ReplayResult(edited=edited)
        # The iterator yields the recorded decisions that have not been compared.
        self._recorded_decisions = filter(None, (_to_decision(timed, edited) for timed in log.events))
        # If the journal lacks the end of the run, its last control step may be incomplete and is ignored.
        self._has_recorded_end = find_run_end(log.events) is not None
        self._has_found_difference = False

    def __call__(self, timed: TimedEvent) -> None:
        decision = _to_decision(timed, self.result.edited)
        if self._has_found_difference or decision is None:
            return
        recorded = next(self._recorded_decisions, None)
        if recorded == decision:
            self.result.decisions += 1
            return
        self._has_found_difference = True
        self.result.unanswered = self.run.station.border.missing_input_message
        # After the last recorded step, the replay only halts its skills.
        self.result.is_complete = decision.tick > self._log.last_tick
        if self._has_recorded_end or any(map(self._is_in_complete_step, filter(None, (recorded, decision)))):
            self.result.recorded = recorded
            self.result.replayed = decision
        self.run.control.stop()

    def compare_end(self) -> None:
        """Compare the end of the replay with the end of the record; called after the replay."""
        recorded = next(self._recorded_decisions, None)
        if self._has_found_difference or recorded is None:
            return
        self.result.is_complete = False
        if self._is_in_complete_step(recorded):
            self.result.recorded = recorded
            self.result.unanswered = self.run.station.border.missing_input_message

    def _is_in_complete_step(self, decision: TimedEvent) -> bool:
        """Return True if the record contains all events of the control step of a decision."""
        return decision.tick < self._log.last_tick


def _to_decision(timed: TimedEvent, edited: bool) -> TimedEvent | None:
    """Return an event without the fields that are not compared; None for an event that is not compared.

    The events of control nodes are not compared if the mission was edited. Messages are never compared,
    because their wording may change.
    """
    event = timed.event
    match event:
        case NodeStarted(node, skill) | NodeEnded(node, _, skill):
            if edited and not skill:
                return None
            event = replace(event, node=get_skill_name(node) if edited else node)
            if isinstance(event, NodeEnded):
                event = replace(event, message="", origin="")
        case events.BranchChosen() if not edited:
            event = replace(event, message="")
        case events.TargetSelected():
            event = replace(event, frame=0)
        case events.ItemChanged():
            event = replace(event, position=(), looks=0, attempts=0, reason="")
        case events.ToolCommanded():
            pass
        case _:
            return None
    return replace(timed, event=event)


def _to_json(decision: TimedEvent | None) -> dict[str, JsonValue] | None:
    """Return tick, clock, kind and non-empty fields of a decision; None without a decision."""
    if decision is None:
        return None
    fields = {key: value for key, value in vars(decision.event).items() if value}
    return {"tick": decision.tick, "clock": decision.clock, "kind": type(decision.event).__name__, **fields}


def _describe_decision(decision: TimedEvent | None) -> str:
    if decision is None:
        return "no further decision"
    fields = vars(decision.event).items()
    values = ", ".join(f"{key} {value}" for key, value in fields if value and key not in ("outputs", "skill"))
    text = f"at {decision.clock:.3f} s (step {decision.tick}) {type(decision.event).__name__}: {values}"
    return shorten_quotations(escape_control_characters(text))


def resume_run(path: Path, skills: Skills, options: RunOptions, record: RecordOptions) -> Result:
    """Resume the run in a directory, and return its result.

    The replay of the journal up to the interruption restores the tree, the variables and the ledger. A
    simulated world is rebuilt from its log, and the arm brakes. The sensor of the tool then determines
    whether the tool holds its item, all positions of items are invalid until the next look, and each
    interrupted skill is restarted.

    If the run ended as INCOMPLETE, the tree is restarted, and rejected and skipped items may be picked again;
    placed items stay placed. If the run ended as SUCCESS or FAILURE without a result file, the result is
    written.

    Args:
        path: The run directory.
        skills: Installed skills by name.
        options: Options of the resumed run; the interrupted run determines seed, requests and files.
        record: Options of the record.

    Raises:
        InputError: Another process executes the run, the run has a result of SUCCESS or FAILURE, the record
            lacks commands to arm or tool, or the replay differs from the record.
        ExecutiveError: The result cannot be written.
    """
    start_time = time.perf_counter()
    directory = RunDirectory(path)
    # The recorder locks the journal, so that no other process writes to the directory.
    recorder = Recorder(directory, saves_pictures=record.saves_pictures, resume=True)
    try:
        events = list(read_journal(directory.journal))
        log = InputLog(events)
        start = find_run_start(events, path, "run the mission again")
        lacks_only_result = _check_end(directory, events)
        loaded = read_mission_of_run(path, start, skills)
        # The control step of a halt or fault is not compared, because a corrected skill may act differently.
        compared_log = log if log.halt is None else log.select_before(log.halt.tick)
        replay = replay_and_compare(loaded, compared_log, start.seed)
        problem = "" if lacks_only_result else compared_log.find_lost_value()
        if not replay.is_equal:
            cause = "The executive, a skill or a model has changed, or a skill has unrecorded inputs"
            problem = f"{replay.difference}. {cause}"
        if problem:
            advice = "run the mission again, or install the version that recorded the run"
            raise InputError(f'the run in "{path}" cannot be resumed: {problem}; {advice}')
        driver_options = {**options.driver_options, **find_recorded_options(path)}
        options = replace(options, seed=start.seed, requests=start.requests, driver_options=driver_options)
        run = assemble_resumed(
            loaded, options, log, directory.world_log,
            is_complete=replay.is_complete, has_ended=lacks_only_result,
        )  # fmt: skip
    except BaseException:
        recorder.close(wait=False)
        raise
    with closing(run):
        replayed_events = run.replay.log.events
        for timed in replayed_events:
            recorder.trace(timed)
        earlier_events = [each for each in replayed_events if isinstance(each.event, EVENTS_WITHOUT_REPLAY)]
        return execute_recorded(run, loaded, recorder, start.seed, start_time, record, earlier_events)


def _check_end(directory: RunDirectory, events: Sequence[TimedEvent]) -> bool:
    """Return True if a run ended as SUCCESS or FAILURE and lacks only its result file.

    Raises:
        InputError: The end of the run prevents a resumption.
    """
    end = find_run_end(events)
    if end is None or (is_resumable(end.status) and not end.held_item):
        return False
    problem = f'the run in "{directory.path}" ended as {end.status}'
    if end.status == "INCOMPLETE":
        advice = "take it out of the tool and run the mission again"
        raise InputError(f"{problem} with {end.held_item} in the tool and cannot be resumed; {advice}")
    if not is_resumable(end.status) and read_result(directory, events) is not None:
        raise InputError(f"{problem}; there is nothing to resume")
    return not is_resumable(end.status)
