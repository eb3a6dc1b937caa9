"""Data and pictures for the report of a run, read from the run directory."""

from __future__ import annotations

import base64
import shlex
from collections.abc import Collection
from dataclasses import dataclass, replace
from operator import attrgetter
from pathlib import Path
from urllib.parse import quote

from executive.mission.text.file_search import get_shipped_folder
from executive.record.diagnosis.diagnosis_text import make_resume_command
from executive.record.journal import find_run_end, find_run_start, read_journal
from executive.record.recorded_mission import read_tree
from executive.record.result import FINAL_STATUSES, list_requests, read_result
from executive.record.run_directory import RunDirectory
from executive.record.timeline.timeline import Timeline
from executive.view.report.activity_times import compute_activity_times
from executive.view.terminal.summary import format_repeat_command

MAX_EMBEDDED_SIZE = 3_000_000
"""Maximum total size of the embedded pictures, so that the page can be sent by e-mail [bytes]."""
INTERRUPTED = "INTERRUPTED"
"""Status of a run whose journal has no end: the run was killed, or is still running."""


@dataclass(frozen=True)
class Picture:
    """Picture of a decision or a failure in a run.

    Attributes:
        source: Value of the attribute `src` of an `img` element: the embedded picture, or a link to its file.
        file: Path of the file, relative to the run directory.
        tick: Control step of the picture.
        item: Name of the object in the picture, or "".
        reason: Reason of the failure; "" for a decision.
    """

    source: str
    file: str
    tick: int
    item: str
    reason: str


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


def collect_pictures(folder: Path, items: Collection[str]) -> list[Picture]:
    """Return the pictures of a run: the last decision for each object, then all failures by time.

    If the pictures are too large for one page, the first pictures are embedded and the others linked.
    `folder` is the folder `frames` of the run; `items` are the names of all items of the run.
    """
    links = [_link_picture(file, items) for file in folder.glob("*.jpg")]
    pictures = sorted(links, key=attrgetter("tick", "file"))
    decisions = {picture.item: picture for picture in pictures if picture.item and not picture.reason}
    failures = [picture for picture in pictures if picture.reason]
    free_size = MAX_EMBEDDED_SIZE
    shown_pictures = []
    for picture in (*decisions.values(), *failures):
        file = folder / Path(picture.file).name
        # Base64 encodes 3 bytes as 4 characters.
        if file.stat().st_size * 4 / 3 <= free_size:
            source = "data:image/jpeg;base64," + base64.b64encode(file.read_bytes()).decode()
            free_size -= len(source)
            picture = replace(picture, source=source)
        shown_pictures.append(picture)
    return shown_pictures


def _link_picture(file: Path, items: Collection[str]) -> Picture:
    """Return a link to a picture, with the information in its file name `<tick>_<item>_<reason>`."""
    path = f"{file.parent.name}/{file.name}"
    tick_text, _, subject = file.stem.partition("_")
    tick = int(tick_text) if tick_text.isdecimal() else 0
    # The name of an item may be the beginning of the name of another item, so long names are tried first.
    for item in sorted(items, key=len, reverse=True):
        if subject == item or subject.startswith(f"{item}_"):
            return Picture(quote(path), path, tick, item, subject.removeprefix(item).removeprefix("_"))
    return Picture(quote(path), path, tick, "", subject)
