"""Report of a run: the data in its run directory, and one self-contained HTML file without scripts."""

from __future__ import annotations

import base64
import shlex
from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import cycle
from operator import attrgetter
from pathlib import Path
from urllib.parse import quote

import yaml
from markupsafe import Markup

from executive.errors import ExecutiveError
from executive.mission.text.file_search import get_shipped_folder
from executive.perception.evidence import describe_unknown_labels
from executive.record.diagnosis import list_labelled_sentences, make_resume_command
from executive.record.journal import find_run_end, find_run_start, read_journal
from executive.record.picture_recorder import PALETTE
from executive.record.result import is_resumable, list_requests, read_result
from executive.record.run_directory import RunDirectory, convert_os_errors, read_tree, write_atomically
from executive.record.timeline import Timeline, find_last_failure, format_counts, group_by_node
from executive.view.report_timeline import FAILED_ATTEMPTS, LOOK, WAITING, compute_activity_times, draw_lanes
from executive.view.svg import NodeResult, make_svg
from executive.view.terminal import describe_place_on_table, format_repeat_command
from executive.view.text import render_template

ACTIVITY_COLOURS = {LOOK: "#56B4E9", FAILED_ATTEMPTS: "#D55E00", WAITING: "#9aa5b4"}
"""Colours of the activities that are not skills; the colour of a skill is another colour of the palette."""
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
        result: Content of `result.json`; None if it is missing, damaged, or older than the last resumption.
        outcome: The result if it exists, else the event `RunEnded`; None if the journal has no end.
        status: `SUCCESS`, `INCOMPLETE`, `FAILURE`, `FAULT`, `HALTED` or `INTERRUPTED`.
        nodes: Nodes of the tree.
        timeline: Timeline of the run.
        last_item_changes: Last change of each item that is not a phantom.
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
        self.outcome = self.result or find_run_end(events)
        self.status = INTERRUPTED if self.outcome is None else self.outcome.status
        self.nodes = read_tree(directory.tree)
        self.timeline = Timeline.from_events(events)
        all_items = self.timeline.items.changes.values()
        self.last_item_changes = [item for item in all_items if item.state != "phantom"]
        self.activity_times = compute_activity_times(self.timeline, self.nodes)
        self.pictures = collect_pictures(directory.pictures, [item.item for item in all_items])
        self.requests = list_requests(self.timeline)
        file = Path(self.start.file)
        mission = file.stem if file.parent == get_shipped_folder() else str(file)
        self.repeat_command = format_repeat_command(
            mission, self.start.seed, self.start.overrides, self.requests, directory.scene
        )
        self.resume_command = make_resume_command(str(path)) if is_resumable(self.status) else ""
        self.replay_command = shlex.join(["executive", "replay", str(path)])


def try_write_report(run_directory: str) -> tuple[str, str]:
    """Write the report of the run in `run_directory`; return file and error message, of which one is "".

    The function raises no exception, because an error of the report must not change the result of the run.
    """
    try:
        return str(write_report(Path(run_directory))), ""
    except ExecutiveError as error:
        return "", f"no report was written: {error}"
    except Exception as error:
        advice = f"`executive --debug report {run_directory}` shows the traceback"
        return "", f"no report was written: {type(error).__name__}: {error}; {advice}"


def write_report(path: Path) -> Path:
    """Write the report of the run in the directory `path` atomically, and return the file of the report.

    Raises:
        InputError: The directory lacks the journal or the tree, or is not writable.
    """
    file = RunDirectory(path).report
    page = render_report(ReportData(path))
    advice = "copy the run directory to a writable folder, and write the report of the copy"
    with convert_os_errors(f'write the report "{file}"', advice):
        write_atomically(file, page)
    return file


def render_report(data: ReportData) -> str:
    """Return the report of a run as HTML; texts of missions and skills are escaped."""
    result, params, outcome = data.result, data.start.params, data.outcome
    # A reason that repeats the status, such as "fault", is omitted.
    reason = "" if outcome is None or outcome.reason.upper() == data.status else outcome.reason
    warning = "" if result is None else result.disagreement
    return render_template(
        "report.html",
        data=data,
        result=result,
        reason=reason,
        verdict=". ".join(filter(None, (warning, _describe_end(data)))),
        to_dict=asdict,
        describe_unknown_labels=describe_unknown_labels,
        list_labelled_sentences=list_labelled_sentences,
        titles={node.path: node.title for node in data.nodes},
        describe_place_on_table=describe_place_on_table,
        colours=_choose_colours(data.activity_times.activities),
        total_times={item: sum(row.values()) for item, row in data.activity_times.times_by_item.items()},
        tree=Markup(make_svg(data.nodes, data.start.mission, _make_node_results(data))),
        timeline=Markup(draw_lanes(data.timeline, data.nodes)),
        params=yaml.safe_dump(dict(params), sort_keys=False, allow_unicode=True) if params else "",
    )


def _describe_end(data: ReportData) -> str:
    """Return a text about the end of the run: the verdict, the message, or the number of placed objects."""
    result, outcome = data.result, data.outcome
    if outcome is None:
        return "The journal has no end: the run was killed, or is still running."
    if verdict := outcome.message if result is None else result.verdict:
        return verdict
    if result is None:
        return "The run ended, but its result.json is missing."
    items = result.items
    if not items.seen:
        return "The mission succeeded; no object was seen."
    unplaced_counts = {"rejected": items.rejected, "skipped": items.skipped, "lost": items.lost}
    unplaced_text = "".join(f", {count} {state}" for state, count in unplaced_counts.items() if count)
    return f"{items.placed} of {items.seen} objects are in their bins{unplaced_text}."


def _choose_colours(activities: Sequence[str]) -> dict[str, str]:
    """Return the colour of each activity as `#rrggbb`."""
    skill_colours = cycle(colour for colour in PALETTE if colour not in ACTIVITY_COLOURS.values())
    return {activity: ACTIVITY_COLOURS.get(activity) or next(skill_colours) for activity in activities}


def _make_node_results(data: ReportData) -> dict[str, NodeResult]:
    """Return the result of each node that ran, by node path."""
    results = {}
    for path, activations in group_by_node(data.timeline.activations).items():
        lines = tuple(filter(None, (format_counts(activations), find_last_failure(activations))))
        results[path] = NodeResult(activations[-1].status, lines)
    return results


def collect_pictures(folder: Path, item_names: Collection[str]) -> list[Picture]:
    """Return the pictures of a run: the last decision for each object, then all failures by time.

    If the pictures are too large for one page, the first pictures are embedded and the others linked.
    `folder` is the folder `frames` of the run; `item_names` are the names of all items of the run.
    """
    links = [_link_picture(file, item_names) for file in folder.glob("*.jpg")]
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


def _link_picture(file: Path, item_names: Collection[str]) -> Picture:
    """Return a link to a picture, with the information in its file name `<tick>_<item>_<reason>`."""
    path = f"{file.parent.name}/{file.name}"
    tick_text, _, subject = file.stem.partition("_")
    tick = int(tick_text) if tick_text.isdecimal() else 0
    # The name of an item may be the beginning of the name of another item, so long names are tried first.
    for item in sorted(item_names, key=len, reverse=True):
        if subject == item or subject.startswith(f"{item}_"):
            return Picture(quote(path), path, tick, item, subject.removeprefix(item).removeprefix("_"))
    return Picture(quote(path), path, tick, "", subject)
