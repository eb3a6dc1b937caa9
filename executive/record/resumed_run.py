"""Resumption of an interrupted run in its own run directory."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from executive.errors import InputError
from executive.events import MotionPlanned, RequestGiven, RunStarted, TimedEvent
from executive.record.journal import find_end, find_start, read_journal
from executive.record.recorded_mission import read_mission_of_run
from executive.record.recorded_run import Recording, RecordOptions
from executive.record.recorder import Recorder
from executive.record.replay import compare
from executive.record.result import ENDED, Result, read_result
from executive.record.run_directory import RunDirectory
from executive.replay.input_log import UNKNOWN_ACTION, InputLog
from executive.replay.replayed_cell import ReplayedCell

if TYPE_CHECKING:
    from executive.run.assembly import RunOptions
    from executive.skill import Skill

NOT_REPEATED = (RunStarted, MotionPlanned, RequestGiven)
"""Kinds of events that a replay does not repeat."""


def resume_run(
    path: Path,
    skills: Mapping[str, type[Skill]],
    options: RunOptions,
    record: RecordOptions,
) -> Result:
    """Resume the run in a directory, and return the result object.

    First, the journal is replayed up to the interruption, which restores the tree, the variables and the
    ledger; a simulated world is rebuilt from its log, with the arm braking. Nothing observed the cell since
    the interruption: the tool's sensor decides whether it holds its item, every position on the table is
    doubted until the next look, and each skill that was running starts again.

    A run that ended as INCOMPLETE is resumed as well: the tree starts again, and rejected and skipped items
    are searched anywhere. Placed items stay placed and counted. Of a run that ended otherwise, but whose
    result was not written any more, the result is written.

    If the world did more than the journal knows, the scene is observed before the run continues.

    Args:
        path: The run directory.
        skills: Installed skills by name.
        options: Options of the resumed run; seed, requests and scene are those of the interrupted run.
        record: Options of the record.

    Raises:
        InputError: The run cannot be resumed: it is still being executed, has succeeded or failed, left too
            short a record, or the present skills would decide differently.
        ExecutiveError: The result cannot be written.
    """
    from executive.run.assembly import assemble_resumed

    began = time.perf_counter()
    directory = RunDirectory(path)
    # Before anything else: from here on no other process writes to the directory.
    recorder = Recorder(directory, frames=record.frames, resume=True)
    try:
        events = read_journal(directory.journal)
        log, start = InputLog.of(events), find_start(events, path, "run the mission again")
        has_ended, seed = _has_ended(directory, events), start.seed
        loaded = read_mission_of_run(path, start, skills)
        # Without the step of a halt or of a bug in a skill: a corrected skill may continue there.
        certain = log if log.halt is None else log.before(log.halt.tick)
        replay = compare(loaded, skills, certain, seed)
        if not replay.same:
            raise InputError(
                f'the run in "{path}" cannot be taken up again: {replay.difference}. The executive or a '
                "skill has been changed since; go back to what it was run with, or run the mission again"
            )
        options = replace(options, seed=seed, requests=start.requests, scene=directory.scene)
        run = assemble_resumed(
            loaded, skills, options, log, directory.world, is_complete=replay.is_complete, has_ended=has_ended
        )
    except BaseException:
        recorder.close(wait=False)
        raise
    with closing(run):
        if record.paused:
            run.control.pause()
        replayed = run.replayed.log
        recorder.remember(replayed.events)
        past = [one for one in replayed.events if isinstance(one.event, NOT_REPEATED)]
        recording = Recording(
            run, loaded, skills, directory, recorder, record.views, past, _describe_gap(run.replayed)
        )
        return recording.execute(seed, began)


def _has_ended(directory: RunDirectory, events: Sequence[TimedEvent]) -> bool:
    """Return True if a run has ended and only its result was not written any more.

    Raises:
        InputError: The run cannot be resumed.
    """
    ending = find_end(events)
    if ending is None:
        return False
    if ending.status == "INCOMPLETE" and ending.holds:
        raise InputError(
            f'the run in "{directory.path}" ended with {ending.holds} in the tool and cannot be '
            "resumed; take it out and run the mission again"
        )
    if ending.status in ENDED and read_result(directory, events) is not None:
        raise InputError(
            f'the run in "{directory.path}" came to its end: {ending.status}; '
            "there is nothing to take up again"
        )
    return ending.status in ENDED


def _describe_gap(replayed: ReplayedCell) -> str:
    """Return a warning if the world of a run did more than the journal knows, else ""."""
    last = replayed.last
    if last is None or last.last_action != UNKNOWN_ACTION:
        return ""
    steps = last.resumed - last.complete
    return (
        f"the journal ends {steps} control steps ({steps * replayed.log.step:.2f} s) before the log of the "
        "world, so actions of the tool are unknown; the whole scene is observed before the run continues"
    )
