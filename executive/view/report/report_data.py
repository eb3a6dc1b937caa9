"""Data for the report of a run, read from the run directory."""

from __future__ import annotations

import shlex
from pathlib import Path

from executive.mission.text.file_search import get_shipped_folder
from executive.record.diagnosis.diagnosis_text import make_resume_command
from executive.record.journal import find_run_end, find_run_start, read_journal
from executive.record.recorded_mission import read_tree
from executive.record.result import FINAL_STATUSES, list_requests, read_result
from executive.record.run_directory import RunDirectory
from executive.record.timeline.timeline import Timeline
from executive.view.report.activity_times import compute_activity_times
from executive.view.report.report_pictures import collect_pictures
from executive.view.terminal.summary import format_repeat_command

INTERRUPTED = "INTERRUPTED"
"""Status of a run whose journal has no end: the run was killed, or is still running."""


class ReportData:
    """Data for the report of a run.

    Args:
        path: Run directory.

    Attributes:
        path: Run directory.
        start: Event of the start of the run.
        result: Content of `result.json`; None if the file is missing or belongs to another run.
        end: Result; without a result, the event of the end of the run; None for an interrupted run.
        status: `SUCCESS`, `INCOMPLETE`, `FAILURE`, `FAULT`, `HALTED` or `INTERRUPTED`.
        nodes: Nodes of the tree.
        timeline: Timeline of the run.
        items: Last change of each item that is not a phantom.
        activity_times: Time of the run by item and activity.
        pictures: Pictures of decisions and failures.
        requests: Requests of the operator, in order.
        repeat_command: Command that repeats the run.
        resume_command: Command that resumes the run, or "" if the run cannot be resumed.
        replay_command: Command that replays the run.

    Raises:
        InputError: The directory lacks the journal or the tree, or the run never started.
    """

    def __init__(self, path: Path) -> None:
        directory = RunDirectory(path)
        events = read_journal(directory.journal)
        self.path = path
        self.start = find_run_start(events, path, "there is nothing to report")
        self.result = read_result(directory, events)
        self.end = self.result or find_run_end(events)
        self.status = INTERRUPTED if self.end is None else self.end.status
        self.nodes = read_tree(directory.tree)
        self.timeline = Timeline.from_events(events)
        all_items = self.timeline.items.list_items()
        self.items = [item for item in all_items if item.state != "phantom"]
        self.activity_times = compute_activity_times(self.timeline, self.nodes)
        self.pictures = collect_pictures(directory.pictures, [item.item for item in all_items])
        self.requests = list_requests(self.timeline)
        file = Path(self.start.file)
        mission = file.stem if file.parent == get_shipped_folder() else str(file)
        self.repeat_command = format_repeat_command(
            mission, self.start.seed, self.start.overrides, self.requests, directory.scene
        )
        self.resume_command = "" if self.status in FINAL_STATUSES else make_resume_command(str(path))
        self.replay_command = shlex.join(["executive", "replay", str(path)])
