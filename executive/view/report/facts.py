"""Facts about a run for its report, from its directory."""

from __future__ import annotations

import shlex
from pathlib import Path

from executive.mission.text.files import shipped_folder
from executive.record.entry import OldEvent, old_entry
from executive.record.journal import read_journal, start_of
from executive.record.recorded_mission import read_tree
from executive.record.result import ENDED, read_result, requests_of
from executive.record.run_directory import RunDirectory
from executive.view.items import ItemTable
from executive.view.report.course import spans
from executive.view.report.pictures import pictures
from executive.view.report.shares import shares
from executive.view.terminal.summary import repeat_command

CUT_OFF = "CUT OFF"
"""Status of a run whose record has no end: it was killed, or goes on."""


class Facts:
    """Facts about a run.

    Args:
        path: The run directory.

    Attributes:
        path: The run directory.
        start: The journal's first entry.
        result: As `result.json` holds it; else what the journal tells of the end, which may be nothing.
        status: `SUCCESS`, `FAILURE`, `FAULT`, `HALTED` or `CUT OFF`.
        end: End of the record, on the run's clock [s].
        nodes: The tree.
        course: Every time that a node ran.
        objects: Last state of each object, phantoms left out.
        shares: Time by object and activity.
        pictures: Pictures of decisions and failures.
        requests: Requests of the operator.
        disturbances: Disturbances brought about in the run, each with its time [s].
        repeat: The command that repeats the run.
        resume: The command that goes on with it; "" for a run that came to its end.
        replay: The command that decides it again.

    Raises:
        InputError: The directory lacks the journal or the tree, or holds a run that had not begun.
    """

    def __init__(self, path: Path) -> None:
        directory = RunDirectory(path)
        events = read_journal(directory.journal)
        entries = [old_entry(timed) for timed in events]
        start = start_of(events, path, "there is nothing to report")
        table = ItemTable()
        for entry in entries:
            if entry["kind"] == "item":
                table(OldEvent("item", entry["tick"], entry["clock"], entry))
        decisions = [(entry["clock"], entry["item"]) for entry in entries if entry["kind"] == "decision"]
        self.path = path
        self.start = start
        self.result = read_result(directory, events)
        self.status = self.result.get("status", CUT_OFF)
        self.end = entries[-1]["clock"]
        self.nodes = read_tree(directory.tree)
        self.course = spans(entries)
        self.objects = [row for row in table.rows if row.state != "phantom"]
        self.shares = shares(self.course, self.nodes, decisions, self.end)
        self.pictures = pictures(directory.frames, [row.item for row in table.rows])
        self.requests = requests_of(events)
        self.disturbances = [
            (each["clock"], each["what"]) for each in entries if each["kind"] == "disturbance"
        ]
        file = Path(start.file)
        mission = file.stem if file.parent == shipped_folder() else str(file)
        self.repeat = repeat_command(mission, start.seed, start.overrides, self.requests, directory.scene)
        ended = self.status in ENDED
        self.resume = "" if ended else shlex.join(["executive", "run", "--resume", str(path)])
        self.replay = shlex.join(["executive", "replay", str(path)])
