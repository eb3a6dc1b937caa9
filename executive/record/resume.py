"""Resumption of an interrupted run in its own run directory."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from executive.errors import InputError
from executive.events import MotionPlanned, RequestGiven, RunStarted, TimedEvent
from executive.record.journal import find_run_end, find_run_start, read_journal
from executive.record.recorded_mission import read_mission_of_run
from executive.record.recorded_run import RecordedRun, RecordOptions
from executive.record.recorder import Recorder
from executive.record.replayed_run import replay_and_compare
from executive.record.result import Result, is_resumable, read_result
from executive.record.run_directory import RunDirectory
from executive.replay.replayed_cell import InputLog
from executive.run.assembly import RunOptions, assemble_resumed
from executive.skill import Skill

EVENTS_WITHOUT_REPLAY = (RunStarted, MotionPlanned, RequestGiven)
"""Kinds of events that a replay does not emit."""


def resume_run(
    path: Path, skills: Mapping[str, type[Skill]], options: RunOptions, record: RecordOptions
) -> Result:
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
        options: Options of the resumed run; the interrupted run determines seed, requests and scene.
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
        events = read_journal(directory.journal)
        log, start = InputLog(events), find_run_start(events, path, "run the mission again")
        lacks_only_result = _check_end(directory, events)
        loaded = read_mission_of_run(path, start, skills)
        # The control step of a halt or fault is not compared, because a corrected skill may act differently.
        compared_log = log if log.halt is None else log.select_before(log.halt.tick)
        replay = replay_and_compare(loaded, compared_log, start.seed)
        problem = "" if lacks_only_result else compared_log.find_lost_value()
        if not replay.is_equal:
            problem = f"{replay.difference}. The executive or a skill has changed, or has unrecorded inputs"
        if problem:
            advice = "run the mission again, or install the version that recorded the run"
            raise InputError(f'the run in "{path}" cannot be resumed: {problem}; {advice}')
        options = replace(options, seed=start.seed, requests=start.requests, scene=directory.scene)
        run = assemble_resumed(
            loaded, options, log, directory.world_log,
            is_complete=replay.is_complete, has_ended=lacks_only_result,
        )  # fmt: skip
    except BaseException:
        recorder.close(wait=False)
        raise
    with closing(run):
        replayed_events = run.replayed_cell.log.events
        for timed in replayed_events:
            recorder.trace(timed)
        earlier_events = [each for each in replayed_events if isinstance(each.event, EVENTS_WITHOUT_REPLAY)]
        recorded_run = RecordedRun(run, loaded, directory, recorder, record, earlier_events)
        return recorded_run.execute(start.seed, start_time)


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
