"""Replay of a recorded run from its recorded inputs, and comparison of the decisions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from pydantic import JsonValue

from executive.errors import InputError, escape_control_characters, shorten_quotations
from executive.events import (
    BranchChosen,
    ItemChanged,
    NodeEnded,
    NodeStarted,
    RunEnded,
    TargetSelected,
    TimedEvent,
    ToolCommanded,
)
from executive.mission.load import LoadedMission
from executive.record.recorded_mission import read_mission_of_run
from executive.record.timeline.activation import skill_name
from executive.replay.input_log import InputLog
from executive.run.assembly import assemble_replay
from executive.run.resume import ResumedRun
from executive.skill import Skill


@dataclass(frozen=True)
class Replay:
    """Result of a replay.

    Attributes:
        decisions: Number of equal decisions.
        ticks: Number of control steps of the replay.
        recorded: First recorded decision that the replay did not repeat, without messages, or None.
        replayed: First decision of the replay that differs from the record, or None.
        edited: True if the mission is not the recorded one.
        unanswered: Message of the question without a recorded answer that ended the replay, or "".
        is_complete: True if the replay repeated the last control step of the record, too.
    """

    decisions: int
    ticks: int
    recorded: TimedEvent | None
    replayed: TimedEvent | None
    edited: bool
    unanswered: str = ""
    is_complete: bool = True

    @property
    def same(self) -> bool:
        """True if all decisions are equal."""
        return self.recorded is None and self.replayed is None

    @property
    def difference(self) -> str:
        """The first difference in words, or ""."""
        if self.same:
            return ""
        both = f"the record says {_describe(self.recorded)}, and now it is {_describe(self.replayed)}"
        if not self.unanswered:
            return both
        return f"{both}: {self.unanswered}; only a run can show the consequences"

    def as_json(self) -> dict[str, JsonValue]:
        """Return the attributes as JSON; a decision has its tick, clock, kind and the fields that are set."""
        decisions = {"recorded": _as_json(self.recorded), "replayed": _as_json(self.replayed)}
        return {**vars(self), **decisions}


def replay(
    path: Path, events: Iterable[TimedEvent], skills: Mapping[str, type[Skill]], mission: Path | None = None
) -> Replay:
    """Replay a recorded run and return the first decision that differs.

    Skills, tree and ledger are the present ones; the answers of arm, tool, camera, detectors and operator
    come from the journal. The replay ends at the first difference.

    Args:
        path: The run directory.
        events: Events of the journal.
        skills: Installed skills by name.
        mission: Another mission file to replay, or None for the recorded mission. For another mission only
            the decisions of skills and the states of items are compared.

    Raises:
        InputError: The directory holds no run that can be replayed.
    """
    log = InputLog.from_events(events)
    run = log.start
    if run is None or not log.inputs:
        raise InputError(
            f'"{path}" holds no run that can be replayed: its journal holds no answers of a cell'
        )
    loaded = read_mission_of_run(path, run, skills, mission)
    edited = mission is not None and loaded.text != (path / "mission.yaml").read_text(encoding="utf-8")
    return compare(loaded, skills, log, run.seed, edited=edited)


def compare(
    loaded: LoadedMission,
    skills: Mapping[str, type[Skill]],
    log: InputLog,
    seed: int,
    *,
    edited: bool = False,
) -> Replay:
    """Replay a log with a mission and return the first decision that differs."""
    comparison = _Comparison(log, edited)
    run = assemble_replay(loaded, skills, log, seed, observers=[comparison])
    comparison.run = run
    run.execute()
    comparison.end()
    recorded, replayed = comparison.difference
    return Replay(
        comparison.same,
        run.tick,
        recorded,
        replayed,
        edited,
        comparison.unanswered,
        comparison.is_complete,
    )


class _Comparison:
    """Observer that compares decisions with the recorded ones.

    Attributes:
        same: Number of equal decisions.
        difference: The first recorded decision that differs, and the new one; None if there is none.
        unanswered: Message of a question without a recorded answer before the first difference, or "".
        is_complete: True if the replay repeated all recorded decisions and had no others in these steps.
        run: The replay; it is stopped at the first difference.
    """

    run: ResumedRun

    def __init__(self, log: InputLog, edited: bool) -> None:
        self._log = log
        self._edited = edited
        self._recorded = [d for timed in log.events if (d := _decision(timed, edited))]
        # The last control step of an interrupted run may be incomplete.
        self._has_ended = any(isinstance(timed.event, RunEnded) for timed in log.events)
        self._is_over = False
        self.same = 0
        self.difference: tuple[TimedEvent | None, TimedEvent | None] = (None, None)
        self.unanswered = ""
        self.is_complete = True

    def __call__(self, timed: TimedEvent) -> None:
        if self._is_over:
            return
        decision = _decision(timed, self._edited)
        if decision is None:
            return
        recorded = self._recorded[self.same] if self.same < len(self._recorded) else None
        if recorded == decision:
            self.same += 1
            return
        self._is_over, self.unanswered = True, self.run.replayed_cell.missing_input_message
        # After the last recorded control step, the replay only halts.
        self.is_complete = decision.tick > self._log.last_tick
        if self._has_ended or self._counts(decision) or (recorded is not None and self._counts(recorded)):
            self.difference = (recorded, decision)
        self.run.control.stop()

    def end(self) -> None:
        """Compare the end of the replay with the end of the record."""
        if self._is_over or self.same == len(self._recorded):
            return
        self.is_complete = False
        if self._counts(self._recorded[self.same]):
            self.difference = (self._recorded[self.same], None)
            self.unanswered = self.run.replayed_cell.missing_input_message

    def _counts(self, decision: TimedEvent) -> bool:
        """Return True if the control step of a decision is complete in the record."""
        return decision.tick < self._log.last_tick


def _decision(timed: TimedEvent, edited: bool) -> TimedEvent | None:
    """Return an event without the fields that are not compared, or None if it is no decision.

    Messages are not compared, because their wording may change.
    """
    event = timed.event
    match event:
        case NodeStarted(node, skill) | NodeEnded(node, _, skill):
            if edited and not skill:
                return None
            event = replace(event, node=skill_name(node) if edited else node)
            if isinstance(event, NodeEnded):
                event = replace(event, message="", origin="")
        case BranchChosen() if not edited:
            event = replace(event, message="")
        case TargetSelected():
            event = replace(event, frame=0)
        case ItemChanged():
            event = replace(event, position=(), looks=0, attempts=0, why="")
        case ToolCommanded():
            pass
        case _:
            return None
    return replace(timed, event=event)


def _as_json(decision: TimedEvent | None) -> dict[str, JsonValue] | None:
    if decision is None:
        return None
    fields = {key: value for key, value in vars(decision.event).items() if value}
    return {
        "tick": decision.tick, "clock": decision.clock, "kind": type(decision.event).__name__, **fields
    }  # fmt: skip


def _describe(decision: TimedEvent | None) -> str:
    """Return a decision in words."""
    if decision is None:
        return "nothing more"
    event = decision.event
    shown = {key: value for key, value in vars(event).items() if value and key not in ("outputs", "skill")}
    values = ", ".join(f"{key} {value}" for key, value in shown.items())
    text = f"at {decision.clock:.3f} s (step {decision.tick}) {type(event).__name__}: {values}"
    return shorten_quotations(escape_control_characters(text))
