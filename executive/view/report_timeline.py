"""Drawing of the timeline of a run, with one lane for each node, and durations of its activities."""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict, deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil

from executive.mission.outline import OutlineNode
from executive.record.timeline import Activation, Timeline, find_last_failure, format_counts, group_by_node
from executive.view.text import estimate_text_width, render_template, wrap_and_truncate

LOOK = "look"
"""Activity: detection of the next item while the tool is empty."""
FAILED_ATTEMPTS = "failed attempts"
"""Activity: failed attempts to pick or place an item, and the looks before the next attempt."""
WAITING = "waiting"
"""Activity: no skill works on an item, moves the arm or senses the scene."""

Interval = tuple[float, float, list[Activation]]
"""Start and end of an interval [s], and the running skills in the order of their starts."""

NO_ITEM = ""
"""Key of the time that belongs to no item, such as the time of the last look at an empty table."""


@dataclass(frozen=True)
class ActivityTimes:
    """Time of a run by item and activity [s].

    Attributes:
        activities: Activities that took time: look, skills by their first use, failed attempts, waiting.
        times_by_item: Time by item and activity; `NO_ITEM` is the last key. The sum of all times is the
            duration of the run.
    """

    activities: tuple[str, ...]
    times_by_item: Mapping[str, Mapping[str, float]]


def compute_activity_times(timeline: Timeline, nodes: Sequence[OutlineNode]) -> ActivityTimes:
    """Return the time by item and activity, from the start of a run to the last event of its timeline.

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
            item, activity = item_activation.item, skills[item_activation.node].skill.lower()
        else:
            nodes_without_item = [skills[activation.node] for activation in running]
            is_look = any(node.senses or "arm" in node.uses for node in nodes_without_item)
            item, activity = _find_next_item(selections, end), LOOK if is_look else WAITING
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
    return ActivityTimes(activities, {item: dict(times[item]) for item in items})


def _split_time(activations: Sequence[Activation], end_time: float) -> Iterator[Interval]:
    """Yield the intervals between successive starts and ends of skills, from 0 to `end_time` [s]."""
    times = {0.0, end_time, *(activation.start for activation in activations)}
    times |= {activation.end for activation in activations}
    later_activations = deque(sorted(activations, key=lambda activation: activation.start))
    running: list[Activation] = []
    for start, end in pairwise(sorted(times)):
        while later_activations and later_activations[0].start <= start:
            running.append(later_activations.popleft())
        running = [activation for activation in running if activation.end > start]
        yield start, end, running


def _find_next_item(selections: Sequence[tuple[float, str]], time: float) -> str:
    """Return the item of the first selection at or after a time [s], or `NO_ITEM`."""
    index = bisect_left(selections, (time, ""))
    return selections[index][1] if index < len(selections) else NO_ITEM


def _find_failed_attempts(
    activations: Sequence[Activation], skills: Mapping[str, OutlineNode], timeline: Timeline
) -> dict[str, tuple[float, float]]:
    """Return, for each item with a failed attempt, the start and the end of its failed attempts [s]."""
    failed_attempts = {}
    for activation in activations:
        skill, item = skills[activation.node], activation.item
        # An attempt fails if a skill that acts on the item fails, not if a look fails.
        if item and activation.status == "FAILURE" and skill.uses and not skill.senses:
            selection_times = [time for time, selected in timeline.selection_times if selected == item]
            first_start = min(other.start for other in activations if other.item == item)
            # Looks before the next attempt count as part of the failed attempt.
            end = next((time for time in selection_times if time > activation.end), activation.end)
            failed_attempts[item] = min(selection_times, default=first_start), end
    return failed_attempts


MIN_AXIS_LENGTH, MAX_AXIS_LENGTH = 900.0, 6000.0
"""Minimum and maximum length of the time axis [pixel]."""
PIXELS_PER_SECOND = 45.0
"""Scale of the time axis between its minimum and maximum length [pixel/s]."""
MIN_GAP, MIN_BAR_WIDTH = 1.0, 3.0
"""Activations share a bar if their gap is below `MIN_GAP` and the bar is below `MIN_BAR_WIDTH` [pixel]."""
MAX_BAR_COUNT = 8000
"""Maximum number of bars in addition to one bar per lane; a bar takes about 250 bytes."""
_LEVEL_INDENT, _FONT_SIZE, _NAME_MARGIN = 9.0, 11.0, 12.0
"""Indentation of a name per tree level, font size of names, and margin between names and bars [pixel]."""
_MAX_NAME_LENGTH = 34
"""Maximum length of the name of a lane [characters]."""
_TICK_PERIODS = (0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800, 3600)
"""Allowed periods of the ticks of the time axis [s]; longer periods are multiples of the longest."""
_MIN_TICK_DISTANCE = 55.0
"""Minimum distance between two ticks of the time axis [pixel]."""
_STATUSES_BY_SEVERITY = ("FAILURE", "RUNNING", "INVALID", "SUCCESS")
"""Statuses of activations, the most severe first."""


@dataclass(frozen=True)
class Bar:
    """Bar of a lane, for one or more activations.

    Attributes:
        start, end: Times at the left and the right end of the bar [s].
        status: Most severe status of the activations in the bar, in lower case.
        tooltip: Text about the activations in the bar.
    """

    start: float
    end: float
    status: str
    tooltip: str


@dataclass(frozen=True)
class Lane:
    """Lane of a node in the drawing.

    Attributes:
        node: Node to which the lane belongs.
        name: Truncated name of the node.
        name_x: The x of the left end of the name [pixel].
        bars: Bars of the activations, in the order of time.
    """

    node: OutlineNode
    name: str
    name_x: int
    bars: Sequence[Bar]


def draw_lanes(timeline: Timeline, nodes: Sequence[OutlineNode]) -> str:
    """Return an SVG document with the activations of a run; the lanes are in the order of the tree.

    Activations that are too close to be distinguished share a bar with the colour of the most severe status,
    so that the size of the document does not depend on the duration of the run.
    """
    activations_by_path, end_time = group_by_node(timeline.activations), timeline.clock
    axis_length = min(max(PIXELS_PER_SECOND * end_time, MIN_AXIS_LENGTH), MAX_AXIS_LENGTH)
    # A run without control steps has the duration 0.
    scale = axis_length / max(end_time, 1e-9)
    groups_by_path = _group_by_bar(activations_by_path, scale)
    lanes = []
    for node in nodes:
        if groups := groups_by_path.get(node.path):
            name = "".join(wrap_and_truncate(node.name, _MAX_NAME_LENGTH))
            bars = [_make_bar(node, group) for group in groups]
            lanes.append(Lane(node, name, round(_LEVEL_INDENT * node.depth), bars))
    name_ends = (lane.name_x + estimate_text_width(lane.name, _FONT_SIZE) for lane in lanes)
    return render_template(
        "timeline.svg",
        axis_x=max(name_ends, default=0.0) + _NAME_MARGIN,
        axis_length=axis_length,
        scale=scale,
        tick_times=_choose_tick_times(end_time, scale),
        lanes=lanes,
    )


def _choose_tick_times(end_time: float, scale: float) -> list[float]:
    """Return the times of the ticks of the time axis, from 0 to `end_time` [s]; `scale` is in pixel/s."""
    min_period, longest_period = _MIN_TICK_DISTANCE / scale, _TICK_PERIODS[-1]
    multiple = longest_period * ceil(min_period / longest_period)
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


def _make_bar(node: OutlineNode, group: Sequence[Activation]) -> Bar:
    """Return the bar of a group of activations of a node."""
    start, end, items = group[0].start, group[-1].end, {activation.item for activation in group}
    item_text = f" of {group[0].item}" if len(items) == 1 and group[0].item else ""
    status_text = group[0].status if len(group) == 1 else format_counts(group)
    heading = f"{node.name}{item_text}: {status_text}"
    times_text = f"{start:.2f} s to {end:.2f} s ({end - start:.2f} s)"
    tooltip = "\n".join(filter(None, (heading, times_text, find_last_failure(group))))
    worst_status = min((activation.status for activation in group), key=_STATUSES_BY_SEVERITY.index)
    return Bar(start, end, worst_status.lower(), tooltip)
