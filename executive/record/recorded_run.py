"""A run with its record: what `executive run` does once and a sweep does for every seed."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from executive.errors import ExecutiveError
from executive.events import Event, Observer
from executive.mission.outline import outline
from executive.mission.text.files import read_source
from executive.record.diagnosis.diagnosis import Story
from executive.record.recorded_mission import tree_text
from executive.record.recorder import Recorder
from executive.record.result import ENDED, result_of, write_result
from executive.record.run_directory import RunDirectory

if TYPE_CHECKING:
    from executive.cell.workcell import Workcell
    from executive.mission.load import LoadedMission
    from executive.run.outcome import Outcome
    from executive.run.run import Run
    from executive.skill import Skill


class View(Protocol):
    """Something a person watches: an observer that is told of the run first and of its end last."""

    def open(self, run: Run) -> None:
        """Begin to show a run; its `control` stops, pauses and steps it."""

    def __call__(self, event: Event) -> None:
        """Take an event and return at once."""

    def close(self) -> None:
        """Stop showing; called at every end of the run."""

    def note(self, sentence: str) -> None:
        """Say something about the record that the person should know."""


def recorded_run(
    loaded: LoadedMission,
    skills: Mapping[str, type[Skill]],
    *,
    seed: int,
    runs: Path,
    views: Sequence[View] = (),
    paused: bool = False,
    gui: bool = False,
    realtime: bool = False,
    requests: Sequence[str] | None = None,
    keyboard: bool = True,
    frames: bool = True,
    kind: Callable[..., Workcell] | None = None,
    scene: Path | None = None,
) -> dict[str, Any]:
    """Run `loaded` once, leave its run directory below `runs` and return the result object.

    Args:
        loaded: The mission and its cell.
        skills: Installed skills by name.
        seed: Decides everything random.
        runs: Folder of the run directories.
        views: Show it.
        paused: Let it stand still before its first step.
        gui: Show the simulated world in a window.
        realtime: Pace the run by the wall clock.
        requests: What the operator asks for, or None to ask at the terminal.
        keyboard: Whether somebody can type there.
        frames: Keep the pictures behind the decisions, and of a run that is over the log of its world.
        kind: Makes the work cell; by default the installed kind that the cell file names.
        scene: File that changes the world of a simulated cell; the run directory gets a copy.

    Raises:
        InputError: The run directory cannot be made, or the cell cannot be built.
        ExecutiveError: The result cannot be written.
    """
    from executive.run.run import Run

    began = time.perf_counter()
    run = Run(
        loaded, skills, seed=seed, gui=gui, realtime=realtime, requests=requests, keyboard=keyboard,
        kind=kind, scene=scene,
    )  # fmt: skip
    with closing(run):
        if paused:
            run.control.pause()
        directory = new_directory(run, loaded, seed, runs, scene)
        recorder = Recorder(directory, frames=frames)
        result = Recording(run, loaded, skills, directory, recorder, views).execute(seed, began)
    if not frames and result["status"] in ENDED:
        # Of a run that is over nothing can be taken up again, and who wants no pictures wants no film.
        directory.world.unlink(missing_ok=True)
    return result


def new_directory(
    run: Run, loaded: LoadedMission, seed: int, runs: Path, scene: Path | None = None
) -> RunDirectory:
    """Make a run's directory below `runs`, with all that it begins from in it, and return it.

    `scene` is the scene file of the run, or None.

    Raises:
        InputError: It cannot be made or written to.
    """
    scene_text = "" if scene is None else read_source(scene).text
    directory = RunDirectory.create(runs, mission=loaded.mission.name, seed=seed, started=datetime.now())
    directory.save_inputs(
        mission=loaded.text,
        params=loaded.params,
        cell=loaded.cell_config.model_dump(mode="json", exclude_unset=True),
        tree=tree_text(outline(run.root)),
        libraries=loaded.libraries,
        scene=scene_text,
    )
    run.log_to(directory.world)
    return directory


@dataclass
class Recording:
    """A run, and all who follow it.

    Attributes:
        run: The run.
        loaded: Its mission.
        skills: Installed skills by name.
        directory: Directory of its record.
        recorder: Keeps the record.
        views: Show the run.
        past: Events before it begins.
    """

    run: Run
    loaded: LoadedMission
    skills: Mapping[str, type[Skill]]
    directory: RunDirectory
    recorder: Recorder
    views: Sequence[View]
    past: Iterable[Event] = ()

    def __post_init__(self) -> None:
        self._noted: list[dict[str, Any]] = []
        self._story = Story(self.loaded, self.skills)

    def execute(self, seed: int, began: float) -> dict[str, Any]:
        """Execute the run and return its result object, which is in the run directory then.

        `began` is when the work on it did [s], by `time.perf_counter`.

        Raises:
            ExecutiveError: The result cannot be written.
        """
        outcome, items, audit = self._watched()
        run, path = self.run, self.directory.path
        result = result_of(
            mission=self.loaded.mission.name, seed=seed, outcome=outcome, items=items, audit=audit,
            noted=self._noted, story=self._story.tell(outcome, path, lambda: run.workcell.cell.arm.at_rest),
            wall_time=time.perf_counter() - began, trace=self.recorder.trace, run=path,
        )  # fmt: skip
        problems = [self.recorder.problem]
        try:
            write_result(self.directory.result, result)
        except ExecutiveError as error:
            problems.append(str(error))
            if result["status"] != "FAULT":
                # What `--json` prints is then all that there is of it.
                result |= {"status": "FAULT", "reason": "fault", "message": str(error), "node": ""}
        if any(problems):
            for view in self.views:
                view.note("; ".join(filter(None, problems)))
        return result

    def _note(self, event: Event) -> None:
        """Keep the plans and requests, which the result counts."""
        if event.kind in ("plan", "request"):
            self._noted.append({"kind": event.kind, **event.data})

    def _watched(self) -> tuple[Outcome, dict[str, Any], Mapping[str, int] | None]:
        """Execute the run with all observers attached, and close them at every end."""
        run, completed = self.run, False
        watchers: list[Observer] = [self._note, self._story, *self.views]
        try:
            for view in self.views:
                view.open(run)
            for watcher in watchers:
                run.observe(watcher)
            for event in self.past:
                for watcher in watchers:
                    watcher(event)
            run.record(self.recorder)
            ended = run.execute(), run.items(), run.audit()
            completed = True
        finally:
            with contextlib.ExitStack() as closing:
                # A user who ends a run by force does not want to wait for its pictures.
                closing.callback(self.recorder.close, wait=completed)
                for view in self.views:
                    closing.callback(view.close)
        return ended
