"""The timeline of a run: a lane for every node that ran, in the order of the tree."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import ceil
from typing import Any

from executive.mission.outline import OutlineNode
from executive.view.report.course import Span, by_node, counts, last_failure
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


def timeline(course: Sequence[Span], nodes: Sequence[OutlineNode], end: float) -> str:
    """Return the timeline as an SVG document, up to the time `end` [s].

    The words of a bar are shown where the pointer rests on it. Activations that cannot be told apart in a
    lane are one bar, in the colour of the worst of them, so the size of the timeline has a bound however long
    the run was.
    """
    ran = by_node(course)
    shown = [node for node in nodes if node.path in ran]
    names = {node.path: "".join(fitted(node.name, _COLUMNS)) for node in shown}
    left = max((_STEP * node.depth + extent(names[node.path], _LETTERS) for node in shown), default=0.0) + 12
    length = min(max(SECOND * end, SHORTEST), LONGEST)
    scale = length / max(end, 1e-9)
    bars = _bars(ran, scale)
    lanes = [
        {
            "kind": "skill" if node.kind == "skill" else "control",
            "path": node.path,
            "name": names[node.path],
            "x": round(_STEP * node.depth),
            "bars": [_bar(node, blot) for blot in bars[node.path]],
        }
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


def _bar(node: OutlineNode, blot: Sequence[Span]) -> dict[str, Any]:
    """Return the times of a bar, its class, which is the worst status in it, and its words."""
    began, ended = blot[0].began, blot[-1].ended
    items = {span.item for span in blot}
    item = f" of {blot[0].item}" if blot[0].item and len(items) == 1 else ""
    how = blot[0].status if len(blot) == 1 else counts(blot)
    when = f"{began:.2f} s to {ended:.2f} s ({ended - began:.2f} s)"
    words = "\n".join(filter(None, (f"{node.name}{item}: {how}", when, last_failure(blot))))
    worst = min((span.status for span in blot), key=_WORST.index)
    return {"began": began, "ended": ended, "kind": worst.lower(), "words": words}
