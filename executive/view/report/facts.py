"""Facts about a run for its report, read from the run directory."""

from __future__ import annotations

import shlex
from pathlib import Path

from executive.mission.text.files import shipped_folder
from executive.record.diagnosis.text import resume_command
from executive.record.journal import find_end, find_start, read_journal
from executive.record.recorded_mission import read_tree
from executive.record.result import FINAL_STATUSES, list_requests, read_result
from executive.record.run_directory import RunDirectory
from executive.record.timeline.timeline import Timeline
from executive.view.report.pictures import collect_pictures
from executive.view.report.shares import compute_shares
from executive.view.terminal.summary import repeat_command

CUT_OFF = "CUT OFF"
"""Status of a run whose record has no end: the run was killed, or is still running."""


class ReportFacts:
    """Facts about a run.

    Args:
        path: The run directory.

    Attributes:
        path: The run directory.
        start: Start of the run.
        result: Content of `result.json`, or None if it does not belong to the journal.
        end: The result, else the end in the journal, else None.
        status: `SUCCESS`, `INCOMPLETE`, `FAILURE`, `FAULT`, `HALTED` or `CUT OFF`.
        nodes: The tree.
        timeline: Timeline of the run.
        objects: Last change of each item, without phantoms.
        shares: Time by object and activity.
        pictures: Pictures of decisions and failures.
        requests: Requests of the operator.
        repeat: The command that repeats the run.
        resume: The command that resumes the run, or "" if the run cannot be resumed.
        replay: The command that replays the run.

    Raises:
        InputError: The directory lacks the journal or the tree, or the run never started.
    """

    def __init__(self, path: Path) -> None:
        directory = RunDirectory(path)
        events = read_journal(directory.journal)
        self.path = path
        self.start = find_start(events, path, "there is nothing to report")
        self.result = read_result(directory, events)
        self.end = self.result or find_end(events)
        self.status = CUT_OFF if self.end is None else self.end.status
        self.nodes = read_tree(directory.tree)
        self.timeline = Timeline.of(events)
        items = self.timeline.items.now()
        self.objects = [item for item in items if item.state != "phantom"]
        self.shares = compute_shares(self.timeline, self.nodes)
        self.pictures = collect_pictures(directory.pictures, [item.item for item in items])
        self.requests = list_requests(self.timeline)
        file = Path(self.start.file)
        mission = file.stem if file.parent == shipped_folder() else str(file)
        origin = mission, self.start.seed, self.start.overrides
        self.repeat = repeat_command(*origin, self.requests, directory.scene)
        self.resume = "" if self.status in FINAL_STATUSES else resume_command(str(path))
        self.replay = shlex.join(["executive", "replay", str(path)])
