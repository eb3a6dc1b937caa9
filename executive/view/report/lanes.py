"""Drawing of the timeline of a run: one lane per node that ran, in the order of the tree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil

from executive.mission.outline import OutlineNode
from executive.record.timeline.activation import Activation, describe_ends, find_last_failure, group_by_node
from executive.record.timeline.timeline import Timeline
from executive.view.text import fit_text, measure_text, render_template

MIN_LENGTH, MAX_LENGTH = 900.0, 6000.0
"""Minimum and maximum length of the time axis [pixel]."""
PIXELS_PER_SECOND = 45.0
"""Scale of a time axis whose length is not limited by `MIN_LENGTH` or `MAX_LENGTH` [pixel/s]."""
MIN_GAP, MIN_WIDTH = 1.0, 3.0
"""Activations share a bar if the gap between them is below `MIN_GAP` and the bar is narrower than `MIN_WIDTH`
[pixel]."""
MAX_BARS = 8000
"""Maximum number of bars in addition to one bar per lane; a bar takes about 250 bytes."""
_INDENT, _FONT_SIZE, _MAX_NAME_LENGTH = 9.0, 11.0, 34
"""Indentation of a name per tree level [pixel], font size [pixel], maximum length of a name [characters]."""
_TICK_PERIODS = (0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800, 3600)
"""Allowed periods of the ticks of the time axis [s]."""
_MIN_TICK_DISTANCE = 55.0
"""Minimum distance between two ticks of the time axis [pixel]."""
_STATUSES_BY_SEVERITY = ("FAILURE", "RUNNING", "INVALID", "SUCCESS")


@dataclass(frozen=True)
class Bar:
    """Bar of a lane.

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
    """Lane of a node: the node, its truncated name, the x of the left end of the name [pixel], its bars."""

    node: OutlineNode
    name: str
    x: int
    bars: Sequence[Bar]


def draw_lanes(timeline: Timeline, nodes: Sequence[OutlineNode]) -> str:
    """Return an SVG document with the activations of a run until its last event.

    Activations that are too close to be distinguished share a bar with the colour of the most severe status,
    so that the size of the document does not depend on the duration of the run.
    """
    activations_by_path, end_time = group_by_node(timeline.activations), timeline.clock
    nodes = [node for node in nodes if node.path in activations_by_path]
    names = {node.path: "".join(fit_text(node.name, _MAX_NAME_LENGTH)) for node in nodes}
    name_ends = (_INDENT * node.depth + measure_text(names[node.path], _FONT_SIZE) for node in nodes)
    left = max(name_ends, default=0.0) + 12
    length = min(max(PIXELS_PER_SECOND * end_time, MIN_LENGTH), MAX_LENGTH)
    scale = length / max(end_time, 1e-9)
    groups_by_path = _group_by_bar(activations_by_path, scale)
    lanes = []
    for node in nodes:
        bars = [_make_bar(node, group) for group in groups_by_path[node.path]]
        lanes.append(Lane(node, names[node.path], round(_INDENT * node.depth), bars))
    ticks = _choose_ticks(end_time, scale)
    return render_template(
        "report/timeline.svg", left=left, length=length, scale=scale, ticks=ticks, lanes=lanes
    )


def _choose_ticks(end_time: float, scale: float) -> list[float]:
    """Return the times of the ticks of the time axis, from 0 to `end_time` [s]; `scale` is in pixel/s."""
    max_period = _TICK_PERIODS[-1] * ceil(_MIN_TICK_DISTANCE / scale / _TICK_PERIODS[-1])
    period = next((period for period in _TICK_PERIODS if period * scale >= _MIN_TICK_DISTANCE), max_period)
    return [number * period for number in range(int(end_time / period) + 1)]


def _group_by_bar(
    activations_by_path: Mapping[str, Sequence[Activation]], scale: float
) -> dict[str, list[list[Activation]]]:
    """Return the activations of each bar by path, in at most `MAX_BARS` bars plus one per lane."""
    divisor = 1
    while True:
        groups = {path: _merge_close(one, scale / divisor) for path, one in activations_by_path.items()}
        if sum(map(len, groups.values())) <= MAX_BARS + len(groups):
            return groups
        divisor *= 2


def _merge_close(activations: Sequence[Activation], scale: float) -> list[list[Activation]]:
    """Return the activations of a node in groups that cannot be distinguished at a scale [pixel/s]."""
    groups: list[list[Activation]] = []
    for activation in activations:
        is_distinct = not groups or (
            (activation.start - groups[-1][-1].end) * scale >= MIN_GAP
            or (activation.end - groups[-1][0].start) * scale >= MIN_WIDTH
        )
        if is_distinct:
            groups.append([])
        groups[-1].append(activation)
    return groups


def _make_bar(node: OutlineNode, group: Sequence[Activation]) -> Bar:
    """Return the bar of a group of activations of a node."""
    first, end = group[0], group[-1].end
    has_one_item = len({activation.item for activation in group}) == 1
    item = f" of {first.item}" if first.item and has_one_item else ""
    status = first.status if len(group) == 1 else describe_ends(group)
    times = f"{first.start:.2f} s to {end:.2f} s ({end - first.start:.2f} s)"
    tooltip = "\n".join(filter(None, (f"{node.name}{item}: {status}", times, find_last_failure(group))))
    worst = min((activation.status for activation in group), key=_STATUSES_BY_SEVERITY.index)
    return Bar(first.start, end, worst.lower(), tooltip)
