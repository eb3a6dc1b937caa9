"""Timeline of a run: a lane for every node that ran, in the order of the tree."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import ceil

from executive.mission.outline import OutlineNode
from executive.record.timeline.activation import Activation, count_ends, find_last_failure, group_by_node
from executive.record.timeline.timeline import Timeline
from executive.view.text import extent, fitted, render

MIN_LENGTH, MAX_LENGTH = 900.0, 6000.0
"""Smallest and largest length of the time axis [pixel]."""
SECOND_LENGTH = 45.0
"""Length of a second, unless the axis would be too short or too long [pixel]."""
MIN_GAP, MAX_GROUP_LENGTH = 1.0, 3.0
"""Activations with a smaller gap are merged into one bar, unless the bar would be too long [pixel]."""
MAX_BARS = 8000
"""Largest number of bars [about 250 bytes each] besides one per lane; more bars are merged."""
_INDENT, _NAME_SIZE, _MAX_NAME_LENGTH = 9.0, 11.0, 34
_TICK_PERIODS = (0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800, 3600)
_MIN_TICK_DISTANCE = 55.0
_WORST_FIRST = ("FAILURE", "RUNNING", "INVALID", "SUCCESS")


@dataclass(frozen=True)
class Bar:
    """Bar of a lane.

    Attributes:
        start, end: Times of its ends [s].
        kind: The worst status of its activations, in lower case.
        words: Text that is shown while the pointer rests on the bar.
    """

    start: float
    end: float
    kind: str
    words: str


@dataclass(frozen=True)
class Lane:
    """Lane of a node: the name, the left end of the name [pixel] and the bars."""

    node: OutlineNode
    name: str
    x: int
    bars: Sequence[Bar]


def draw_lanes(timeline: Timeline, nodes: Sequence[OutlineNode]) -> str:
    """Return the activations of a run as an SVG document, up to its last event.

    The words of a bar are shown while the pointer rests on it. Activations of a lane that cannot be
    distinguished are merged into one bar with the worst status, so that the size of the document is bounded.
    """
    ran, end = group_by_node(timeline.activations), timeline.clock
    shown = [node for node in nodes if node.path in ran]
    names = {node.path: "".join(fitted(node.name, _MAX_NAME_LENGTH)) for node in shown}
    left = (
        max((_INDENT * node.depth + extent(names[node.path], _NAME_SIZE) for node in shown), default=0.0) + 12
    )
    length = min(max(SECOND_LENGTH * end, MIN_LENGTH), MAX_LENGTH)
    scale = length / max(end, 1e-9)
    bars = _group_bars(ran, scale)
    lanes = [
        Lane(
            node,
            names[node.path],
            round(_INDENT * node.depth),
            [_make_bar(node, group) for group in bars[node.path]],
        )
        for node in shown
    ]
    ticks = _place_ticks(end, scale)
    return render("report/timeline.svg", left=left, length=length, scale=scale, ticks=ticks, lanes=lanes)


def _place_ticks(end: float, scale: float) -> Iterator[float]:
    """Yield the times that are written above the lanes [s]."""
    longest = _TICK_PERIODS[-1] * ceil(_MIN_TICK_DISTANCE / scale / _TICK_PERIODS[-1])
    step = next((step for step in _TICK_PERIODS if step * scale >= _MIN_TICK_DISTANCE), longest)
    for number in range(int(end / step) + 1):
        yield number * step


def _group_bars(lanes: Mapping[str, Sequence[Activation]], scale: float) -> dict[str, list[list[Activation]]]:
    """Return the activations of each bar of each lane."""
    coarse = 1
    while True:
        bars = {path: list(_merge(lane, scale / coarse)) for path, lane in lanes.items()}
        if sum(map(len, bars.values())) <= MAX_BARS + len(bars):
            return bars
        coarse *= 2


def _merge(lane: Sequence[Activation], scale: float) -> Iterator[list[Activation]]:
    """Yield the activations of a lane in groups that are too close to be distinguished."""
    group: list[Activation] = []
    for activation in lane:
        if group and (
            (activation.start - group[-1].end) * scale >= MIN_GAP
            or (activation.end - group[0].start) * scale >= MAX_GROUP_LENGTH
        ):
            yield group
            group = []
        group.append(activation)
    if group:
        yield group


def _make_bar(node: OutlineNode, group: Sequence[Activation]) -> Bar:
    """Return the bar of a group of activations."""
    start, end = group[0].start, group[-1].end
    items = {activation.item for activation in group}
    item = f" of {group[0].item}" if group[0].item and len(items) == 1 else ""
    how = group[0].status if len(group) == 1 else count_ends(group)
    when = f"{start:.2f} s to {end:.2f} s ({end - start:.2f} s)"
    words = "\n".join(filter(None, (f"{node.name}{item}: {how}", when, find_last_failure(group))))
    worst = min((activation.status for activation in group), key=_WORST_FIRST.index)
    return Bar(start, end, worst.lower(), words)
