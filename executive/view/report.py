"""Report of a run: one self-contained HTML file without scripts, from the data in the run directory.

The page contains the timeline, with one lane for each node, and the durations of activities by item.
"""

from __future__ import annotations

import base64
import math
import shlex
from bisect import bisect_left
from collections import defaultdict, deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import cycle, pairwise
from operator import attrgetter
from pathlib import Path
from urllib.parse import quote

import yaml
from markupsafe import Markup

from executive.errors import ExecutiveError, InputError, explain_os_errors
from executive.mission.outline import OutlineNode
from executive.perception.evidence import describe_unknown_labels
from executive.record.journal import find_run_end, find_run_start, read_journal
from executive.record.picture_recorder import PALETTE, split_picture_name
from executive.record.result import (
    is_resumable,
    list_labelled_sentences,
    list_requests,
    make_resume_command,
    read_result,
)
from executive.record.run_directory import RunDirectory, find_recorded_options, read_tree, write_atomically
from executive.record.timeline import Activation, Timeline, find_last_failure, format_counts, group_by_node
from executive.text.files import get_shipped_folder
from executive.view import drawing
from executive.view.drawing import NodeResult
from executive.view.terminal import describe_place_on_table, format_repeat_command

LOOK = "look"
"""Activity: detection of the next item while the tool is empty."""
FAILED_ATTEMPTS = "failed attempts"
"""Activity: failed attempts to pick or place an item, and the looks before the next attempt."""
WAITING = "waiting"
"""Activity: no skill works on an item, moves the arm or senses the scene."""
NO_ITEM = ""
"""Key of the time that belongs to no item, such as the time of the last look at an empty table."""
ACTIVITY_COLOURS = {LOOK: "#56B4E9", FAILED_ATTEMPTS: "#D55E00", WAITING: "#9aa5b4"}
"""Colours of the activities that are not skills; the colour of a skill is another colour of the palette."""
MAX_EMBEDDED_SIZE = 3_000_000
"""Maximum total size of the embedded pictures, so that the page can be sent by e-mail [bytes]."""
MAX_CARD_COUNT = 100
"""Maximum number of items with a card and pictures; the items before them are rows of a table."""
INTERRUPTED = "INTERRUPTED"
"""Status of a run whose journal has no end: the run was killed, or is still running."""


@dataclass
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
        activities, times_by_item: Activities of the run, and their times by item.
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
        self.path = path
        self.start = find_run_start(read_journal(directory.journal), path, "there is nothing to report")
        self.timeline = Timeline.from_events(read_journal(directory.journal))
        self.result = read_result(directory, self.timeline.ends)
        self.outcome = self.result or find_run_end(self.timeline.ends)
        self.status = INTERRUPTED if self.outcome is None else self.outcome.status
        self.nodes = read_tree(directory.tree)
        all_items = self.timeline.items.changes.values()
        self.last_item_changes = [item for item in all_items if item.state != "phantom"]
        self.activities, self.times_by_item = compute_activity_times(self.timeline, self.nodes)
        names = [*(item.item for item in all_items), *self.timeline.unexplained]
        self.pictures = collect_pictures(directory.pictures, names)
        self.requests = list_requests(self.timeline)
        file = Path(self.start.file)
        mission = file.stem if file.parent == get_shipped_folder() else str(file)
        options = {"cell": self.start.cell, **find_recorded_options(path)}
        self.repeat_command = format_repeat_command(
            mission, self.start.seed, self.start.overrides, self.requests, options
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
    with explain_os_errors(InputError, f'cannot write the report "{file}"', advice):
        write_atomically(file, page)
    return file


def render_report(data: ReportData) -> str:
    """Return the report of a run as HTML; texts of missions and skills are escaped."""
    result = data.result
    params = data.start.params
    outcome = data.outcome
    # A reason that repeats the status, such as "fault", is omitted.
    reason = "" if outcome is None or outcome.reason.upper() == data.status else outcome.reason
    warning = "" if result is None else result.disagreement
    skill_colours = cycle(colour for colour in PALETTE if colour not in ACTIVITY_COLOURS.values())
    return drawing.render_template(
        "report.html",
        data=data,
        result=result,
        reason=reason,
        verdict=". ".join(filter(None, (warning, _describe_end(data)))),
        to_dict=asdict,
        max_card_count=MAX_CARD_COUNT,
        describe_unknown_labels=describe_unknown_labels,
        list_labelled_sentences=list_labelled_sentences,
        titles={node.path: node.title for node in data.nodes},
        describe_place_on_table=describe_place_on_table,
        colours={name: ACTIVITY_COLOURS.get(name) or next(skill_colours) for name in data.activities},
        total_times={item: sum(row.values()) for item, row in data.times_by_item.items()},
        tree=Markup(drawing.make_svg(data.nodes, data.start.mission, _make_node_results(data))),
        timeline=Markup(draw_lanes(data.timeline, data.nodes)),
        params=yaml.safe_dump(dict(params), sort_keys=False, allow_unicode=True) if params else "",
    )


def _describe_end(data: ReportData) -> str:
    """Return a text about the end of the run: the verdict, the message, or the number of placed objects."""
    result = data.result
    if data.outcome is None:
        return "The journal has no end: the run was killed, or is still running."
    if verdict := data.outcome.message if result is None else result.verdict:
        return verdict
    if result is None:
        return "The run ended, but its result.json is missing."
    items = result.items
    if not items.seen:
        return "The mission succeeded; no object was seen."
    unplaced_counts = {"rejected": items.rejected, "skipped": items.skipped, "lost": items.lost}
    unplaced_text = "".join(f", {count} {state}" for state, count in unplaced_counts.items() if count)
    return f"{items.placed} of {items.seen} objects are in their bins{unplaced_text}."


def _make_node_results(data: ReportData) -> dict[str, NodeResult]:
    results = {}
    for path, activations in group_by_node(data.timeline.activations).items():
        lines = tuple(filter(None, (format_counts(activations), find_last_failure(activations))))
        results[path] = NodeResult(activations[-1].status, lines)
    return results


def collect_pictures(folder: Path, item_names: Collection[str]) -> list[Picture]:
    """Return the pictures of a run: the last decision for each object, then all failures by time.

    If the pictures are too large for one page, some are linked: first failures, then decisions for the first
    objects.
    `folder` is the folder `frames` of the run; `item_names` are the names of all items of the run.
    """
    links = [_link_picture(file, item_names) for file in folder.glob("*.jpg")]
    pictures = sorted(links, key=attrgetter("tick", "file"))
    decisions = {picture.item: picture for picture in pictures if picture.item and not picture.reason}
    failures = [picture for picture in pictures if picture.reason]
    shown_pictures = [*decisions.values(), *failures]
    free_size = MAX_EMBEDDED_SIZE
    for picture in (*reversed(decisions.values()), *failures):
        file = folder / Path(picture.file).name
        # Base64 encodes 3 bytes as 4 characters.
        if file.stat().st_size * 4 / 3 <= free_size:
            picture.source = "data:image/jpeg;base64," + base64.b64encode(file.read_bytes()).decode()
            free_size -= len(picture.source)
    return shown_pictures


def _link_picture(file: Path, item_names: Collection[str]) -> Picture:
    path = f"{file.parent.name}/{file.name}"
    tick, subject = split_picture_name(file)
    # The name of an item may be the beginning of the name of another item, so long names are tried first.
    for item in sorted(item_names, key=len, reverse=True):
        if subject == item or subject.startswith(f"{item}_"):
            return Picture(quote(path), path, tick, item, subject.removeprefix(item).removeprefix("_"))
    return Picture(quote(path), path, tick, "", subject)


TimesByItem = Mapping[str, Mapping[str, float]]
"""Time by item and activity [s]; `NO_ITEM` is the last key. The sum is the duration of the run."""


def compute_activity_times(
    timeline: Timeline, nodes: Sequence[OutlineNode]
) -> tuple[tuple[str, ...], TimesByItem]:
    """Return activities, and times by item, from the start of a run to the last event of its timeline.

    The activities are those that took time: look, skills by their first use, failed attempts, waiting.

    If several skills run, the time belongs to the first started skill that works on an item. Time without
    such a skill belongs to the item that is selected next. `timeline.has_history` must be true.
    """
    skills = {node.path: node for node in nodes if node.kind == "skill"}
    activations = [activation for activation in timeline.activations if activation.node in skills]
    selections = timeline.selection_times
    times: dict[str, dict[str, float]] = defaultdict(lambda: defaultdict(float))
    # The dictionary without values is used as an ordered set.
    skill_activities: dict[str, None] = {}
    failed_attempts = _find_failed_attempts(activations, skills, timeline)
    for start, end, running in _split_time(activations, timeline.clock):
        item_activation = next((activation for activation in running if activation.item), None)
        if item_activation is not None:
            item = item_activation.item
            activity = skills[item_activation.node].skill.lower()
        else:
            index = bisect_left(selections, (end, ""))
            item = selections[index][1] if index < len(selections) else NO_ITEM
            running_nodes = [skills[activation.node] for activation in running]
            is_look = any(node.senses or "arm" in node.uses for node in running_nodes)
            activity = LOOK if is_look else WAITING
        failed_start, failed_end = failed_attempts.get(item, (0.0, 0.0))
        if failed_start <= start and end <= failed_end:
            activity = FAILED_ATTEMPTS
        elif item_activation is not None:
            skill_activities[activity] = None
        times[item][activity] += end - start
    # A skill may have the name of another activity, so duplicates are removed.
    all_activities = dict.fromkeys([LOOK, *skill_activities, FAILED_ATTEMPTS, WAITING])
    activities = tuple(name for name in all_activities if any(name in row for row in times.values()))
    items = sorted(times, key=lambda item: item == NO_ITEM)
    return activities, {item: dict(times[item]) for item in items}


def _split_time(
    activations: Sequence[Activation], end_time: float
) -> Iterator[tuple[float, float, list[Activation]]]:
    """Yield start [s], end [s] and running skills of the intervals between successive starts and ends.

    The intervals last from 0 to `end_time` [s]; the skills are in the order of their starts.
    """
    times = {0.0, end_time, *(activation.start for activation in activations)}
    times |= {activation.end for activation in activations}
    later_activations = deque(sorted(activations, key=lambda activation: activation.start))
    running: list[Activation] = []
    for start, end in pairwise(sorted(times)):
        while later_activations and later_activations[0].start <= start:
            running.append(later_activations.popleft())
        running = [activation for activation in running if activation.end > start]
        yield start, end, running


def _find_failed_attempts(
    activations: Sequence[Activation], skills: Mapping[str, OutlineNode], timeline: Timeline
) -> dict[str, tuple[float, float]]:
    """Return, for each item with a failed attempt, the start and the end of its failed attempts [s]."""
    failed_attempts = {}
    for activation in activations:
        skill = skills[activation.node]
        item = activation.item
        # An attempt fails if a skill that acts on the item fails, not if a look fails.
        if item and activation.status == "FAILURE" and skill.uses and not skill.senses:
            selection_times = [time for time, selected in timeline.selection_times if selected == item]
            first_start = min(other.start for other in activations if other.item == item)
            # Looks before the next attempt count as part of the failed attempt.
            end = next((time for time in selection_times if time > activation.end), activation.end)
            failed_attempts[item] = min(selection_times, default=first_start), end
    return failed_attempts


MIN_AXIS_LENGTH = 900.0
MAX_AXIS_LENGTH = 6000.0
"""Minimum and maximum length of the time axis [pixel]."""
PIXELS_PER_SECOND = 45.0
"""Scale of the time axis between its minimum and maximum length [pixel/s]."""
MIN_GAP = 1.0
MIN_BAR_WIDTH = 3.0
"""Activations share a bar if their gap is below `MIN_GAP` and the bar is below `MIN_BAR_WIDTH` [pixel]."""
MAX_BAR_COUNT = 8000
"""Maximum number of bars in addition to one bar per lane; a bar takes about 250 bytes."""
_LEVEL_INDENT = 9
"""Indentation of a name per tree level [pixel]."""
_NAME_SIZE = 11.0
"""Font size of names [pixel]."""
_NAME_MARGIN = 12.0
"""Margin between names and bars [pixel]."""
_MAX_NAME_LENGTH = 34
"""Maximum length of the name of a lane [characters]."""
_TICK_PERIODS = (0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800, 3600)
"""Allowed periods of the ticks of the time axis [s]; longer periods are multiples of the longest."""
_MIN_TICK_DISTANCE = 55.0
"""Minimum distance between two ticks of the time axis [pixel]."""
_STATUSES_BY_SEVERITY = ("FAILURE", "RUNNING", "INVALID", "SUCCESS")
"""Statuses of activations, the most severe first."""


def draw_lanes(timeline: Timeline, nodes: Sequence[OutlineNode]) -> str:
    """Return an SVG document with the activations of a run; the lanes are in the order of the tree.

    Activations that are too close to be distinguished share a bar with the colour of the most severe status,
    so that the size of the document does not depend on the duration of the run.
    """
    end_time = timeline.clock
    axis_length = min(max(PIXELS_PER_SECOND * end_time, MIN_AXIS_LENGTH), MAX_AXIS_LENGTH)
    # A run without control steps has the duration 0.
    scale = axis_length / max(end_time, 1e-9)
    groups_by_path = _group_by_bar(group_by_node(timeline.activations), scale)
    lanes = []
    axis_x = _NAME_MARGIN
    for node in nodes:
        if groups := groups_by_path.get(node.path):
            name = "".join(drawing.wrap_and_truncate(node.name, _MAX_NAME_LENGTH))
            name_x = _LEVEL_INDENT * node.depth
            axis_x = max(axis_x, name_x + drawing.estimate_text_width(name, _NAME_SIZE) + _NAME_MARGIN)
            lanes.append((node, name, name_x, [_make_bar(node, group) for group in groups]))
    return drawing.render_template(
        "timeline.svg",
        axis_x=axis_x,
        axis_length=axis_length,
        scale=scale,
        tick_times=_choose_tick_times(end_time, scale),
        lanes=lanes,
    )


def _choose_tick_times(end_time: float, scale: float) -> list[float]:
    """Return the times of the ticks of the time axis, from 0 to `end_time` [s]; `scale` is in pixel/s."""
    min_period = _MIN_TICK_DISTANCE / scale
    multiple = _TICK_PERIODS[-1] * math.ceil(min_period / _TICK_PERIODS[-1])
    period = next((period for period in _TICK_PERIODS if period >= min_period), multiple)
    return [number * period for number in range(int(end_time / period) + 1)]


def _group_by_bar(
    activations_by_path: Mapping[str, Sequence[Activation]], scale: float
) -> dict[str, list[list[Activation]]]:
    """Return groups of activations, one per bar, by node path; at most `MAX_BAR_COUNT` plus one per lane.

    If there are too many bars at the scale `scale` of the drawing [pixel/s], the scale is halved repeatedly.
    """
    while True:
        groups_by_path = {path: _group_activations(each, scale) for path, each in activations_by_path.items()}
        if sum(map(len, groups_by_path.values())) <= MAX_BAR_COUNT + len(groups_by_path):
            return groups_by_path
        scale /= 2


def _group_activations(activations: Sequence[Activation], scale: float) -> list[list[Activation]]:
    """Return the activations of a node in groups that cannot be distinguished at a scale [pixel/s]."""
    groups: list[list[Activation]] = []
    for activation in activations:
        if groups and (
            (activation.start - groups[-1][-1].end) * scale < MIN_GAP
            and (activation.end - groups[-1][0].start) * scale < MIN_BAR_WIDTH
        ):
            groups[-1].append(activation)
        else:
            groups.append([activation])
    return groups


def _make_bar(node: OutlineNode, group: Sequence[Activation]) -> tuple[float, float, str, str]:
    """Return start [s], end [s], most severe status in lower case, and tooltip of a bar."""
    start = group[0].start
    end = group[-1].end
    items = {activation.item for activation in group}
    item_text = f" of {group[0].item}" if len(items) == 1 and group[0].item else ""
    status_text = group[0].status if len(group) == 1 else format_counts(group)
    heading = f"{node.name}{item_text}: {status_text}"
    times_text = f"{start:.2f} s to {end:.2f} s ({end - start:.2f} s)"
    tooltip = "\n".join(filter(None, (heading, times_text, find_last_failure(group))))
    worst_status = min((activation.status for activation in group), key=_STATUSES_BY_SEVERITY.index)
    return start, end, worst_status.lower(), tooltip
