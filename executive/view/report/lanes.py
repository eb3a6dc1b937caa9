"""The timeline of a run: a lane for every node that ran, in the order of the tree."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from executive.mission.outline import OutlineNode
from executive.view.report.course import Span
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
_STEP, _LETTERS, _COLUMNS = 9.0, 11.0, 34
_TICKS = (0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800, 3600)
_APART = 55.0


def timeline(course: Sequence[Span], nodes: Sequence[OutlineNode], end: float) -> str:
    """Return the timeline as an SVG document, up to the time `end` [s].

    What happened is said where the pointer rests on a bar. Bars of one lane that end alike and cannot be told
    apart are one, so its size does not grow with the length of the run.
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
        for span in _told_apart(lanes[node.path], scale):
            bar = add(
                lane, "rect", span.status.lower(), x=f"{left + scale * span.began:.1f}",
                y=f"{y + (ROW - thickness) / 2:.1f}", height=f"{thickness:.0f}",
                width=f"{max(scale * (span.ended - span.began), THINNEST):.1f}",
            )  # fmt: skip
            add(bar, "title", text=_words(node, span))
    return ElementTree.tostring(picture, encoding="unicode")


def _ticks(end: float, scale: float) -> Iterator[float]:
    """Yield the times that are written above the lanes."""
    step = next((step for step in _TICKS if step * scale >= _APART), _TICKS[-1])
    for number in range(int(end / step) + 1):
        yield number * step


def _told_apart(lane: Sequence[Span], scale: float) -> Iterator[Span]:
    """Yield the spans of a lane; those that would be one blot to the eye as one."""
    last: Span | None = None
    for span in lane:
        alike = last is not None and (last.status, last.item) == (span.status, span.item)
        if (
            last is not None
            and alike
            and (span.began - last.ended) * scale < 1 < (span.ended - last.began) * scale < 3
        ):
            last = replace(last, ended=span.ended)
            continue
        if last is not None:
            yield last
        last = span
    if last is not None:
        yield last


def _words(node: OutlineNode, span: Span) -> str:
    """Return what is said of a bar."""
    item = f" of {span.item}" if span.item else ""
    when = f"{span.began:.2f} s to {span.ended:.2f} s ({span.ended - span.began:.2f} s)"
    why = ": ".join(filter(None, (span.reason, span.message)))
    return "\n".join(filter(None, (f"{node.name}{item}: {span.status}", when, why)))
