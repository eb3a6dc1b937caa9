"""What a report says of a run, gathered from its directory."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from executive.errors import InputError
from executive.events import Event
from executive.mission.outline import OutlineNode
from executive.mission.text.files import shipped_folder
from executive.record.journal import ending_of, read_journal
from executive.record.recorded_tree import read_tree
from executive.record.requests import Requests
from executive.record.result import ENDED, EXIT_CODES
from executive.record.run_directory import RunDirectory
from executive.view.items import ItemTable, Row
from executive.view.repeat import repeat_command
from executive.view.report.course import Entry, Span, spans
from executive.view.report.pictures import Pictures, pictures
from executive.view.report.shares import Shares, shares

CUT_OFF = "CUT OFF"
"""Status of a run whose record has no end: it was killed, or goes on."""


@dataclass(frozen=True)
class Facts:
    """What there is to say of a run.

    Attributes:
        path: Its directory.
        start: The journal's first entry.
        status: `SUCCESS`, `FAILURE`, `FAULT`, `HALTED` or `CUT OFF`.
        end: When its record ends, on the run's clock [s].
        result: As `result.json` holds it; else what the journal tells of the end, which may be nothing.
        nodes: Its tree.
        course: Every time that a node ran.
        objects: What became of each object; what never was is left out.
        shares: Where the time went.
        pictures: What was seen.
        requests: What the operator asked for.
        disturbances: What was brought about in it, each with its time [s].
    """

    path: Path
    start: Entry
    status: str
    end: float
    result: Mapping[str, Any]
    nodes: Sequence[OutlineNode]
    course: Sequence[Span]
    objects: Sequence[Row]
    shares: Shares
    pictures: Pictures
    requests: Sequence[str]
    disturbances: Sequence[tuple[float, str]]

    @property
    def repeat(self) -> str:
        """The command that repeats it."""
        file = Path(self.start["file"])
        mission = file.stem if file.parent == shipped_folder() else str(file)
        overrides, seed = self.start["overrides"], self.start["seed"]
        return repeat_command(mission, seed=seed, overrides=overrides, requests=self.requests)

    @property
    def resume(self) -> str:
        """The command that goes on with it; "" for a run that came to its end."""
        return "" if self.status in ENDED else shlex.join(["executive", "run", "--resume", str(self.path)])

    @property
    def replay(self) -> str:
        """The command that decides it anew."""
        return shlex.join(["executive", "replay", str(self.path)])


def gather(path: Path) -> Facts:
    """Return what the record in a run directory has to say.

    Raises:
        InputError: The directory lacks the journal or the tree, or holds a run that had not begun.
    """
    directory = RunDirectory(path)
    entries = read_journal(directory.journal)
    start = next((entry for entry in entries if entry["kind"] == "run"), None)
    if start is None:
        raise InputError(f'the run in "{path}" had not begun when it was cut off; there is nothing to report')
    nodes = read_tree(directory.tree)
    course = spans(entries)
    table, requests = ItemTable(), Requests()
    for entry in entries:
        event = Event(entry["kind"], entry["tick"], entry["clock"], entry)
        if event.kind == "item":
            table(event)
        requests(event)
    decisions = [(entry["clock"], entry["item"]) for entry in entries if entry["kind"] == "decision"]
    result, end = _result(directory, entries), entries[-1]["clock"]
    return Facts(
        path=path,
        start=start,
        status=result.get("status", CUT_OFF),
        end=end,
        result=result,
        nodes=nodes,
        course=course,
        objects=[row for row in table.rows if row.state != "phantom"],
        shares=shares(course, nodes, decisions, end),
        pictures=pictures(directory.frames, [row.item for row in table.rows]),
        requests=requests.words,
        disturbances=[(entry["clock"], entry["what"]) for entry in entries if entry["kind"] == "disturbance"],
    )


def _result(directory: RunDirectory, entries: Sequence[dict[str, Any]]) -> Mapping[str, Any]:
    """Return the result that belongs to this record; of a run that was cut off there is none."""
    ending = ending_of(entries)
    try:
        result = json.loads(directory.result.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        result = None
    told = {} if not isinstance(result, dict) else result
    if ending is not None:
        # Of a run that was taken up again it may be that of an end before the last.
        same = all(told.get(key) == ending[key] for key in ("status", "ticks"))
        return told if same else ending
    # Where the disk did not take the end, the result alone knows of it.
    once = all(entry["kind"] != "resume" for entry in entries)
    return told if once and told.get("status") in EXIT_CODES else {}
