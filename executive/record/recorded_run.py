"""A run with its record: what `executive run` does once and a sweep does for every seed."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import closing
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from executive.events import Event
from executive.record.planning import PlanningTally
from executive.record.recorder import Recorder
from executive.record.result import result_of, write_result
from executive.record.run_directory import RunDirectory

if TYPE_CHECKING:
    from py_trees.behaviour import Behaviour

    from executive.mission.load import LoadedMission
    from executive.skill import Skill


class View(Protocol):
    """Something a person watches: an observer that is told the tree first and the end last."""

    def open(self, root: Behaviour) -> None:
        """Begin to show a run of this tree."""

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
    view: View | None = None,
    gui: bool = False,
    realtime: bool = False,
    requests: Sequence[str] | None = None,
    frames: bool = True,
) -> dict[str, Any]:
    """Run `loaded` once, leave its run directory below `runs` and return the result object.

    Raises:
        InputError: The run directory cannot be made, or the cell cannot be built.
        ExecutiveError: The result cannot be written.
    """
    from executive.runtime.run import Run

    began = time.perf_counter()
    with closing(Run(loaded, skills, seed=seed, gui=gui, realtime=realtime, requests=requests)) as run:
        directory = RunDirectory.create(runs, mission=loaded.mission.name, seed=seed, started=datetime.now())
        directory.save_inputs(
            mission=loaded.text,
            params=loaded.params,
            cell=loaded.cell_config.model_dump(mode="json"),
            libraries=loaded.libraries,
        )
        recorder = Recorder(directory, frames=frames)
        run.observe(recorder)
        planning = PlanningTally()
        run.observe(planning)
        completed = False
        try:
            if view is not None:
                run.observe(view)
                view.open(run.root)
            outcome = run.execute()
            items, audit = run.items(), run.audit()
            completed = True
        finally:
            if view is not None:
                view.close()
            # Whoever ends a run by force does not want to wait for its pictures.
            recorder.close(wait=completed)
    result = result_of(
        mission=loaded.mission.name, seed=seed, outcome=outcome, items=items, audit=audit,
        planning=planning.figures(),
        wall_time=time.perf_counter() - began, trace=recorder.trace, run=directory.path,
    )  # fmt: skip
    write_result(directory.result, result)
    if view is not None and recorder.problem:
        view.note(recorder.problem)
    return result
