"""Timeline of a run: a lane for each node that ran, in the order of the tree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil

from executive.mission.outline import OutlineNode
from executive.record.timeline.activation import Activation, count_ends, find_last_failure, group_by_node
from executive.record.timeline.timeline import Timeline
from executive.view.text import fit_text, measure_text, render_template

MIN_LENGTH, MAX_LENGTH = 900.0, 6000.0
"""Shortest and longest time axis [pixel]."""
PIXELS_PER_SECOND = 45.0
"""Scale of a time axis between the shortest and the longest [pixel/s]."""
MIN_GAP, MIN_WIDTH = 1.0, 3.0
"""Activations with a smaller gap, which are narrower together, share a bar [pixel]."""
MAX_BARS = 8000
"""Largest number of bars besides one per lane; a bar takes about 250 bytes."""
_INDENT, _FONT_SIZE, _COLUMNS = 9.0, 11.0, 34
_TICK_PERIODS = (0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800, 3600)
_MIN_TICK_DISTANCE = 55.0
_WORST_FIRST = ("FAILURE", "RUNNING", "INVALID", "SUCCESS")


@dataclass(frozen=True)
class Bar:
    """Bar of a lane.

    Attributes:
        start, end: Times of its ends [s].
        kind: The worst status of its activations, in lower case.
        tooltip: Text about its activations.
    """

    start: float
    end: float
    kind: str
    tooltip: str


@dataclass(frozen=True)
class Lane:
    """Lane of a node: the name, its left end [pixel] and the bars."""

    node: OutlineNode
    name: str
    x: int
    bars: Sequence[Bar]


def draw_lanes(timeline: Timeline, nodes: Sequence[OutlineNode]) -> str:
    """Return the activations of a run until its last event as an SVG document.

    Activations that cannot be distinguished share a bar in the colour of the worst of them, so the size of
    the document is bounded however long the run was.
    """
    activations, end = group_by_node(timeline.activations), timeline.clock
    shown = [node for node in nodes if node.path in activations]
    names = {node.path: "".join(fit_text(node.name, _COLUMNS)) for node in shown}
    name_ends = (_INDENT * node.depth + measure_text(names[node.path], _FONT_SIZE) for node in shown)
    left = max(name_ends, default=0.0) + 12
    length = min(max(PIXELS_PER_SECOND * end, MIN_LENGTH), MAX_LENGTH)
    scale = length / max(end, 1e-9)
    groups = _group_by_bar(activations, scale)
    lanes = []
    for node in shown:
        bars = [_make_bar(node, group) for group in groups[node.path]]
        lanes.append(Lane(node, names[node.path], round(_INDENT * node.depth), bars))
    ticks = _choose_ticks(end, scale)
    return render_template(
        "report/timeline.svg", left=left, length=length, scale=scale, ticks=ticks, lanes=lanes
    )


def _choose_ticks(end: float, scale: float) -> list[float]:
    """Return the times that are written above the lanes [s]."""
    longest = _TICK_PERIODS[-1] * ceil(_MIN_TICK_DISTANCE / scale / _TICK_PERIODS[-1])
    period = next((period for period in _TICK_PERIODS if period * scale >= _MIN_TICK_DISTANCE), longest)
    return [number * period for number in range(int(end / period) + 1)]


def _group_by_bar(
    lanes: Mapping[str, Sequence[Activation]], scale: float
) -> dict[str, list[list[Activation]]]:
    """Return the activations of each bar of each lane, at most `MAX_BARS` bars and one per lane."""
    coarseness = 1
    while True:
        groups = {path: _group_close(lane, scale / coarseness) for path, lane in lanes.items()}
        if sum(map(len, groups.values())) <= MAX_BARS + len(groups):
            return groups
        coarseness *= 2


def _group_close(lane: Sequence[Activation], scale: float) -> list[list[Activation]]:
    """Return the activations of a lane in groups that cannot be distinguished at a scale [pixel/s]."""
    groups: list[list[Activation]] = []
    for activation in lane:
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
    status = first.status if len(group) == 1 else count_ends(group)
    times = f"{first.start:.2f} s to {end:.2f} s ({end - first.start:.2f} s)"
    tooltip = "\n".join(filter(None, (f"{node.name}{item}: {status}", times, find_last_failure(group))))
    worst = min((activation.status for activation in group), key=_WORST_FIRST.index)
    return Bar(first.start, end, worst.lower(), tooltip)
