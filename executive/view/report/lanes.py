"""The timeline of a run: a lane for every node that ran, in the order of the tree."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import ceil
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from executive.mission.outline import OutlineNode
from executive.view.report.course import Span, tallies
from executive.view.svg_element import add
from executive.view.text import extent, fitted

ROW, HEAD, FOOT = 17.0, 22.0, 6.0
"""Height of a lane, of the clock above the lanes, and of what is free below [pixel]."""
SHORTEST, LONGEST = 900.0, 6000.0
"""Between these is the length of the time axis [pixel]."""
SECOND = 45.0
"""Length of a second where that is neither too short nor too long in all [pixel]."""
THINNEST = 1.5
"""Width of what took no time [pixel]."""
APART, BLOT = 1.0, 3.0
"""What is closer to each other and not longer together is one blot to the eye [pixel]."""
MOST = 8000
"""Bars of a timeline [about 250 bytes each], and one more for every lane; of more, coarser blots are made."""
_STEP, _LETTERS, _COLUMNS = 9.0, 11.0, 34
_TICKS = (0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800, 3600)
_CLOCK = 55.0
_WORST = ("FAILURE", "RUNNING", "INVALID", "SUCCESS")


def timeline(course: Sequence[Span], nodes: Sequence[OutlineNode], end: float) -> str:
    """Return the timeline as an SVG document, up to the time `end` [s].

    What happened is said where the pointer rests on a bar. What cannot be told apart in a lane is one bar, in
    the colour of the worst in it, so the size of the timeline has a bound however long the run was.
    """
    lanes: dict[str, list[Span]] = {}
    for span in course:
        lanes.setdefault(span.node, []).append(span)
    shown = [node for node in nodes if node.path in lanes]
    names = {node.path: "".join(fitted(node.name, _COLUMNS)) for node in shown}
    left = max((_STEP * node.depth + extent(names[node.path], _LETTERS) for node in shown), default=0.0) + 12
    length = min(max(SECOND * end, SHORTEST), LONGEST)
    scale = length / max(end, 1e-9)
    width, height = left + length + 12, HEAD + ROW * len(shown) + FOOT
    bars = _bars(lanes, scale)
    picture = Element(
        "svg",
        {
            "xmlns": "http://www.w3.org/2000/svg", "class": "timeline", "role": "img",
            "width": f"{width:.0f}", "height": f"{height:.0f}", "viewBox": f"0 0 {width:.0f} {height:.0f}",
        },
    )  # fmt: skip
    add(picture, "title", text="What every node did, and when")
    for time in _ticks(end, scale):
        x = left + scale * time
        add(picture, "path", "tick", d=f"M{x:.1f} {HEAD - 4:.0f}V{height - FOOT:.0f}")
        add(picture, "text", "clock", f"{time:g} s", x=f"{x:.1f}", y=f"{HEAD - 8:.0f}")
    for row, node in enumerate(shown):
        y = HEAD + ROW * row
        kind = "skill" if node.kind == "skill" else "control"
        lane = add(picture, "g", f"lane {kind}", **{"data-path": node.path})
        add(lane, "text", "name", names[node.path], x=f"{_STEP * node.depth:.0f}", y=f"{y + 12:.0f}")
        thickness = ROW - 5 if kind == "skill" else 5.0
        for blot in bars[node.path]:
            began, ended = blot[0].began, blot[-1].ended
            bar = add(
                lane, "rect", _worst(blot).lower(), x=f"{left + scale * began:.1f}",
                y=f"{y + (ROW - thickness) / 2:.1f}", height=f"{thickness:.0f}",
                width=f"{max(scale * (ended - began), THINNEST):.1f}",
            )  # fmt: skip
            add(bar, "title", text=_words(node, blot))
    return ElementTree.tostring(picture, encoding="unicode")


def _ticks(end: float, scale: float) -> Iterator[float]:
    """Yield the times that are written above the lanes."""
    longest = _TICKS[-1] * ceil(_CLOCK / scale / _TICKS[-1])
    step = next((step for step in _TICKS if step * scale >= _CLOCK), longest)
    for number in range(int(end / step) + 1):
        yield number * step


def _bars(lanes: Mapping[str, Sequence[Span]], scale: float) -> dict[str, list[list[Span]]]:
    """Return what each bar of each lane stands for."""
    coarse = 1
    while True:
        bars = {path: list(_told_apart(lane, scale / coarse)) for path, lane in lanes.items()}
        if sum(map(len, bars.values())) <= MOST + len(bars):
            return bars
        coarse *= 2


def _told_apart(lane: Sequence[Span], scale: float) -> Iterator[list[Span]]:
    """Yield the spans of a lane, together those that would be one blot to the eye."""
    blot: list[Span] = []
    for span in lane:
        if blot and (
            (span.began - blot[-1].ended) * scale >= APART or (span.ended - blot[0].began) * scale >= BLOT
        ):
            yield blot
            blot = []
        blot.append(span)
    if blot:
        yield blot


def _worst(blot: Sequence[Span]) -> str:
    """Return the status by which the others are told."""
    return min((span.status for span in blot), key=_WORST.index)


def _words(node: OutlineNode, blot: Sequence[Span]) -> str:
    """Return what is said of a bar."""
    began, ended, tally = blot[0].began, blot[-1].ended, tallies(blot)[node.path]
    items = {span.item for span in blot}
    item = f" of {blot[0].item}" if blot[0].item and len(items) == 1 else ""
    how = tally.status if len(blot) == 1 else tally.counts
    when = f"{began:.2f} s to {ended:.2f} s ({ended - began:.2f} s)"
    return "\n".join(filter(None, (f"{node.name}{item}: {how}", when, tally.said)))
