"""Execution of a run that is recorded in a run directory and shown by views."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Protocol

import yaml

from executive.cell.devices import find_driver_options
from executive.errors import ExecutiveError, InputError, Interrupted, describe_error
from executive.events import Observer, TimedEvent, UnexplainedChanged
from executive.mission.load import LoadedMission
from executive.mission.outline import make_outline
from executive.record.diagnose import diagnose
from executive.record.journal import Recorder
from executive.record.picture_recorder import find_picture
from executive.record.result import (
    Audit,
    ItemCounts,
    Result,
    UnexplainedEntry,
    is_resumable,
    list_requests,
    write_result,
)
from executive.record.run_directory import RunDirectory, format_tree, make_dated_folder
from executive.record.timeline import Timeline
from executive.run.assembly import RunOptions, assemble
from executive.run.run import Run
from executive.text.files import read_source


class View(Protocol):
    """Display of a run for a person: an observer that is opened before the run and closed after the run."""

    def open(self, run: Run) -> None:
        """Begin to show a run; the view may stop, pause and step the run through `run.control`."""

    def __call__(self, timed: TimedEvent) -> None:
        """Accept an event and return at once."""

    def close(self) -> None:
        """Stop showing the run; called after the end of the run, also after an exception."""

    def show_message(self, message: str) -> None:
        """Show a message about the record of the run."""


class GuardedView:
    """View that forwards all calls to another view, and closes that view after its first error.

    Attributes:
        problem: Message about the first error of the view, or "".
    """

    def __init__(self, view: View) -> None:
        self._view = view
        self.problem = ""

    def open(self, run: Run) -> None:
        """Begin to show a run."""
        self._forward(lambda: self._view.open(run))

    def __call__(self, timed: TimedEvent) -> None:
        """Show an event."""
        self._forward(lambda: self._view(timed))

    def close(self) -> None:
        """Stop showing the run."""
        self._forward(self._view.close)

    def show_message(self, message: str) -> None:
        """Show a message about the record of the run."""
        self._forward(lambda: self._view.show_message(message))

    def _forward(self, call: Callable[[], None]) -> None:
        """Call the view; after its first error, close the view and ignore all later calls."""
        if self.problem:
            return
        try:
            call()
        except Exception as error:
            view_name = type(self._view).__name__
            self.problem = f"the view {view_name} failed during the run: {type(error).__name__}: {error}"
            # A view that stays open would block the screen and the keyboard.
            with contextlib.suppress(Exception):
                self._view.close()


@dataclass(frozen=True)
class RecordOptions:
    """Options of the record and of the display of a run.

    Attributes:
        views: Views of the run.
        starts_paused: True to pause the run before its first control step.
        saves_pictures: True to save pictures, and to keep the log of the simulated world for a video.
        timeline: Timeline of the run, which receives the events first; None: one without history.
    """

    views: Sequence[View] = ()
    starts_paused: bool = False
    saves_pictures: bool = True
    timeline: Timeline | None = None


def record_run(
    loaded: LoadedMission, options: RunOptions, runs_folder: Path, record: RecordOptions = RecordOptions()
) -> Result:
    """Run a mission, record the run in a new directory below `runs_folder`, and return the result.

    Args:
        loaded: The mission and its cell.
        options: Options of the run; the run directory gets copies of the files of its driver.
        runs_folder: Folder of the run directories.
        record: Options of the record.

    Raises:
        InputError: The run directory cannot be made, or the cell cannot be built.
        ExecutiveError: The result cannot be written.
    """
    start_time = time.perf_counter()
    run = assemble(loaded, options)
    with closing(run):
        directory = make_run_directory(run, loaded, options, runs_folder)
        recorder = Recorder(directory, saves_pictures=record.saves_pictures)
        result = execute_recorded(run, loaded, recorder, options.seed, start_time, record)
    if not record.saves_pictures and not is_resumable(result.status):
        # Only a resumption and a video need the log of the simulated world.
        directory.world_log.unlink(missing_ok=True)
    return result


def make_run_directory(run: Run, loaded: LoadedMission, options: RunOptions, folder: Path) -> RunDirectory:
    """Make and return the directory of a run below `folder`, with its inputs.

    Raises:
        InputError: The directory cannot be made, or a file cannot be written.
    """
    cell = loaded.cell_config.model_dump(mode="json", exclude_unset=True)
    texts = {
        "mission.yaml": loaded.text,
        "params.yaml": yaml.safe_dump(loaded.params, sort_keys=False, allow_unicode=True),
        "cell.yaml": yaml.safe_dump(cell, sort_keys=False, allow_unicode=True),
        "tree.json": format_tree(make_outline(run.root)),
    }
    for option, value in options.driver_options.items():
        if find_driver_options(loaded.cell_config.kind)[option] == "file":
            file_name = f"{option}.yaml"
            if file_name in texts:
                raise InputError(f'an option of a driver may not be called "{option}"; rename it')
            texts[file_name] = read_source(Path(value)).text
    name = f"{loaded.mission.name}_s{options.seed}"
    directory = RunDirectory(make_dated_folder(folder, name, datetime.now()))
    directory.save_inputs(texts, loaded.libraries)
    run.station.log_to(directory.world_log)
    return directory


def execute_recorded(
    run: Run, loaded: LoadedMission, recorder: Recorder, seed: int, start_time: float,
    options: RecordOptions = RecordOptions(), earlier_events: Sequence[TimedEvent] = (),
) -> Result:  # fmt: skip
    """Execute a run with its recorder and its views, write and return its result.

    Args:
        run: Run without views and recorder.
        loaded: Mission of the run.
        recorder: Recorder of the run.
        seed: Seed of the run.
        start_time: Value of `time.perf_counter()` at the start [s].
        options: Views of the run, and whether the run starts paused.
        earlier_events: Events from before the resumption of the run; the observers receive them first.

    Raises:
        ExecutiveError: The result cannot be written.
    """
    timeline = options.timeline or Timeline(has_history=False)
    observers: list[Observer] = [timeline, *options.views]
    if options.starts_paused:
        run.control.pause()
    with contextlib.ExitStack() as exit_stack:
        # An exception is reported at once, without waiting for the pictures.
        exit_stack.push(lambda exception_type, *_: recorder.close(wait=exception_type is None))
        for view in options.views:
            exit_stack.callback(view.close)
        for view in options.views:
            view.open(run)
        for observer in observers:
            run.add_observer(observer)
            for timed in earlier_events:
                observer(timed)
        run.add_recorder(recorder)
        run_end = run.execute()
        audit = None
        try:
            audit = run.station.audit()
        except Interrupted:
            raise
        except BaseException as error:  # The driver may be code of another project.
            message = f"the true state of the world cannot be read: {describe_error(error)}"
            run_end = replace(run_end, status="FAULT", reason="fault", message=message, node="")
            run.emit(run_end)
    station = run.station
    path = recorder.directory.path
    item_counts = station.ledger.count_states()
    end_values = asdict(run_end)
    end_values["robot_time_s"] = end_values.pop("robot_time")
    result = Result(
        **end_values,
        mission=loaded.mission.name,
        seed=seed,
        items=ItemCounts(**item_counts),
        unknown_labels=station.ledger.unknown_labels,
        assumption_reasons=station.ledger.assumption_reasons,
        unexplained=[_make_entry(event, recorder.directory) for event in timeline.unexplained.values()],
        audit=None if audit is None else Audit.from_counts(item_counts, audit, run_end.is_table_empty),
        planning=timeline.planning,
        requests=list_requests(timeline),
        wall_time_s=round(time.perf_counter() - start_time, 3),
        trace=recorder.trace.hexdigest(),
        run=str(path),
        diagnosis=diagnose(timeline, run_end, loaded, path, lambda: station.cell.arm.at_rest),
    )
    problems = [recorder.problem] if recorder.problem else []
    try:
        write_result(recorder.directory.result, result)
    except ExecutiveError as error:
        problems.append(str(error))
        if result.status != "FAULT":
            # Without a result file, the output of `--json` must report the problem.
            result = replace(result, status="FAULT", reason="fault", message=str(error), node="")
    for view in options.views if problems else ():
        view.show_message("; ".join(problems))
    return result


def _make_entry(event: UnexplainedChanged, directory: RunDirectory) -> UnexplainedEntry:
    """Return the entry of the result about an event, with the path of its picture."""
    picture = find_picture(directory.pictures, event.name, "")
    file = "" if picture is None else f"{picture.parent.name}/{picture.name}"
    return UnexplainedEntry(event.name, event.text, event.position, file)
