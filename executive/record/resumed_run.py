"""A run that was cut off, taken up again where it was, in its own directory."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from executive.errors import InputError
from executive.events import Event
from executive.record.journal import ending_of, read_journal, start_of
from executive.record.recorded_mission import recorded_mission
from executive.record.recorded_run import Recording, View
from executive.record.recorder import Recorder
from executive.record.replay import compare
from executive.record.result import ENDED
from executive.record.run_directory import RunDirectory
from executive.replay.input_log import Entry, Past

if TYPE_CHECKING:
    from executive.cell.workcell import Workcell
    from executive.skill import Skill

UNPLAYED = ("run", "plan", "request")
"""Events that do not come about again when a past is played."""


def resumed_run(
    path: Path,
    skills: Mapping[str, type[Skill]],
    *,
    views: Sequence[View] = (),
    paused: bool = False,
    gui: bool = False,
    realtime: bool = False,
    keyboard: bool = True,
    frames: bool = True,
    kind: Callable[..., Workcell] | None = None,
) -> dict[str, Any]:
    """Take up again the run in a directory, and return the result object.

    Its journal is played to where it was cut off: then tree, variables and ledger are what they were. The
    world of a simulated cell is rebuilt as it was, too, the arm braking. Since nobody watched the cell
    meanwhile, the tool's sensor decides what is held, everything on the table is in doubt until it was seen
    again, and each skill that was under way begins anew.

    A run that ended as INCOMPLETE is resumed as well: the tree begins again, and rejected and skipped items
    are sought anew, wherever somebody has put them. Placed items stay placed and counted.

    Args:
        path: The run directory.
        skills: Installed skills by name.
        views: Show it.
        paused: Let it stand still before its first new step.
        gui: Show the simulated world in a window.
        realtime: Pace the run by the wall clock.
        keyboard: Whether somebody can type at the terminal.
        frames: Keep the pictures behind the decisions.
        kind: Makes the work cell; by default the installed kind that the cell file names.

    Raises:
        InputError: There is nothing to take up: the run goes on, has succeeded or failed, left too little of
            a record, or would be decided otherwise by what is installed now.
        ExecutiveError: The result cannot be written.
    """
    from executive.run.run import Run

    began = time.perf_counter()
    directory = RunDirectory(path)
    # First of all: from here on no other process writes to the directory.
    recorder = Recorder(directory, frames=frames, again=True)
    try:
        past, start = _past(directory)
        seed = int(start["seed"])
        loaded = recorded_mission(path, start, skills)
        # Not the step in which it was halted or in which a skill broke: a mended skill may go on there.
        taken_up = past if past.halt is None else past.before(int(past.halt["tick"]))
        replay = compare(loaded, skills, taken_up, seed)
        if not replay.same:
            raise InputError(
                f'the run in "{path}" cannot be taken up again: {replay.difference}. The executive or a '
                "skill has been changed since; go back to what it was run with, or run the mission anew"
            )
        run = Run(
            loaded, skills, seed=seed, gui=gui, realtime=realtime, requests=start["requests"],
            keyboard=keyboard, kind=kind, past=past, takes_up=directory.world, scene=directory.scene,
        )  # fmt: skip
    except BaseException:
        recorder.close(wait=False)
        raise
    with closing(run):
        if paused:
            run.control.pause()
        assert run.played is not None, "a run that is taken up again plays its past"
        recorder.remember(run.played.entries)
        told = _events(run.played)
        return Recording(run, loaded, skills, directory, recorder, views, told).execute(seed, began)


def _past(directory: RunDirectory) -> tuple[Past, Entry]:
    """Return what a run to take up again has had, and how it began.

    Raises:
        InputError: There is nothing to take up.
    """
    entries = read_journal(directory.journal)
    ending = ending_of(entries)
    if ending is not None and ending["status"] == "INCOMPLETE" and ending["holds"]:
        raise InputError(
            f'the run in "{directory.path}" ended with {ending["holds"]} in the tool and cannot be '
            "resumed; take it out and run the mission anew"
        )
    if ending is not None and ending["status"] in ENDED:
        raise InputError(
            f'the run in "{directory.path}" came to its end: {ending["status"]}; '
            "there is nothing to take up again"
        )
    return Past.of(entries), start_of(entries, directory.path, "run the mission anew")


def _events(past: Past) -> Iterator[Event]:
    """Yield what those who follow a run have to know, and are not told when its past is played."""
    for entry in past.entries:
        if entry["kind"] in UNPLAYED:
            data = {key: value for key, value in entry.items() if key not in ("tick", "clock", "kind")}
            yield Event(entry["kind"], entry["tick"], entry["clock"], data)
