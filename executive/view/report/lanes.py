"""The timeline of a run: a lane for every node that ran, in the order of the tree."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import ceil

from executive.mission.outline import OutlineNode
from executive.record.timeline.activation import Activation, count_ends, find_last_failure, group_by_node
from executive.record.timeline.timeline import Timeline
from executive.view.text import extent, fitted, render

SHORTEST, LONGEST = 900.0, 6000.0
"""Between these is the length of the time axis [pixel]."""
SECOND = 45.0
"""Length of a second where that is neither too short nor too long in all [pixel]."""
APART, BLOT = 1.0, 3.0
"""What is closer to each other and not longer together is one blot to the eye [pixel]."""
MOST = 8000
"""Bars of a timeline [about 250 bytes each], and one more for every lane; of more, coarser blots are made."""
_STEP, _LETTERS, _COLUMNS = 9.0, 11.0, 34
_TICKS = (0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800, 3600)
_CLOCK = 55.0
_WORST = ("FAILURE", "RUNNING", "INVALID", "SUCCESS")


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
    """Lane of a node: the name, its left end [pixel] and the bars."""

    node: OutlineNode
    name: str
    x: int
    bars: Sequence[Bar]


def draw_lanes(timeline: Timeline, nodes: Sequence[OutlineNode]) -> str:
    """Return the activations of a run as an SVG document, up to its last event.

    The words of a bar are shown while the pointer rests on it. Activations that cannot be distinguished in a
    lane are one bar, in the colour of the worst of them, so the size of the document has a bound however long
    the run was.
    """
    ran, end = group_by_node(timeline.activations), timeline.clock
    shown = [node for node in nodes if node.path in ran]
    names = {node.path: "".join(fitted(node.name, _COLUMNS)) for node in shown}
    left = max((_STEP * node.depth + extent(names[node.path], _LETTERS) for node in shown), default=0.0) + 12
    length = min(max(SECOND * end, SHORTEST), LONGEST)
    scale = length / max(end, 1e-9)
    bars = _bars(ran, scale)
    lanes = [
        Lane(
            node, names[node.path], round(_STEP * node.depth), [_bar(node, blot) for blot in bars[node.path]]
        )
        for node in shown
    ]
    ticks = _ticks(end, scale)
    return render("report/timeline.svg", left=left, length=length, scale=scale, ticks=ticks, lanes=lanes)


def _ticks(end: float, scale: float) -> Iterator[float]:
    """Yield the times that are written above the lanes."""
    longest = _TICKS[-1] * ceil(_CLOCK / scale / _TICKS[-1])
    step = next((step for step in _TICKS if step * scale >= _CLOCK), longest)
    for number in range(int(end / step) + 1):
        yield number * step


def _bars(lanes: Mapping[str, Sequence[Activation]], scale: float) -> dict[str, list[list[Activation]]]:
    """Return what each bar of each lane stands for."""
    coarse = 1
    while True:
        bars = {path: list(_told_apart(lane, scale / coarse)) for path, lane in lanes.items()}
        if sum(map(len, bars.values())) <= MOST + len(bars):
            return bars
        coarse *= 2


def _told_apart(lane: Sequence[Activation], scale: float) -> Iterator[list[Activation]]:
    """Yield the activations of a lane, together those that would be one blot to the eye."""
    blot: list[Activation] = []
    for one in lane:
        if blot and (
            (one.start - blot[-1].end) * scale >= APART or (one.end - blot[0].start) * scale >= BLOT
        ):
            yield blot
            blot = []
        blot.append(one)
    if blot:
        yield blot


def _bar(node: OutlineNode, blot: Sequence[Activation]) -> Bar:
    """Return the bar of activations that look like one."""
    start, end = blot[0].start, blot[-1].end
    items = {one.item for one in blot}
    item = f" of {blot[0].item}" if blot[0].item and len(items) == 1 else ""
    how = blot[0].status if len(blot) == 1 else count_ends(blot)
    when = f"{start:.2f} s to {end:.2f} s ({end - start:.2f} s)"
    words = "\n".join(filter(None, (f"{node.name}{item}: {how}", when, find_last_failure(blot))))
    worst = min((one.status for one in blot), key=_WORST.index)
    return Bar(start, end, worst.lower(), words)
