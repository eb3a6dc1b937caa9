"""A tree as a picture: one SVG that needs nothing else, for a page as for a file.

Every node is a group with the class `node`; a page shows how it fares by giving it one more, `running`,
`success` or `failure`, and raises its line above its siblings' by appending the group once more. What a page
says of it stands in its texts of the class `note`. What is behind the picture, light or dark, shines through.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from executive.mission.outline import OutlineNode, children
from executive.view.svg_element import add, at
from executive.view.text import extent, fitted
from executive.view.tree.card import COLUMNS, Card, card
from executive.view.tree.layout import FRAME, Layout, Rectangle, Size, layout
from executive.view.tree.style import LINE, NAME, SLOT, STYLE, TITLE

_NOT_ID = re.compile(r"[^A-Za-z0-9_/]")
_PADDING = 11.0
_BADGE = 20.0
_FIRST_LINE = 28.0
_NEXT_LINE = 14.0
_BASELINE = 18.5
_CORNER = 6.0
_AFTER_SLOT = 4.0


@dataclass(frozen=True)
class Note:
    """How a node fared in a run.

    Attributes:
        status: As `status` events have it, or "" for one that never ran.
        lines: What is said of it, below what the mission says; a line that is too long is cut.
    """

    status: str = ""
    lines: tuple[str, ...] = ()


def svg(nodes: Sequence[OutlineNode], name: str, notes: Mapping[str, Note] = MappingProxyType({})) -> str:
    """Return the picture of a tree as an SVG document.

    Args:
        nodes: Its outline.
        name: The mission's, for the title.
        notes: How its nodes fared, by path; nothing is said of the others.
    """
    below = children(nodes)
    cards = [card(node) for node in nodes]
    said = [_said(notes.get(node.path)) for node in nodes]
    sizes = [_size(*each) for each in zip(nodes, cards, said, strict=True)]
    plan = layout([node.depth for node in nodes], below, sizes)
    parents = {child: parent for parent, among in enumerate(below) for child in among}
    picture = Element("svg", _canvas(plan))
    add(picture, "title", text=name)
    add(picture, "style", text=STYLE)
    for index, frame in plan.frames.items():
        _add_frame(picture, nodes[index], frame)
    for index, (node, shown) in enumerate(zip(nodes, cards, strict=True)):
        note = notes.get(node.path, Note())
        kinds = "node skill" if node.kind == "skill" else f"node control {node.kind}"
        group = add(picture, "g", f"{kinds} {note.status.lower()}".rstrip(), **_marks(node))
        add(group, "title", text="\n".join((shown.tooltip, *filter(None, note.lines))))
        if index in parents:
            parent = plan.boxes[parents[index]]
            _add_line(group, node, parent, plan.boxes[index], plan.trunks[node.depth])
        _add_box(group, shown, said[index], plan.boxes[index])
    ElementTree.indent(picture)
    return ElementTree.tostring(picture, encoding="unicode")


def identifier(path: str) -> str:
    """Return the id of a node's group: its path, with `-` for `/` and `--hex-` for what an id cannot hold."""
    return "node-" + _NOT_ID.sub(lambda found: f"--{ord(found[0]):x}-", path).replace("/", "-")


def _canvas(plan: Layout) -> dict[str, str]:
    width, height = f"{plan.width:.0f}", f"{plan.height:.0f}"
    return {
        "xmlns": "http://www.w3.org/2000/svg",
        "class": "behaviour-tree",
        "role": "img",
        "width": width,
        "height": height,
        "viewBox": f"0 0 {width} {height}",
    }


def _marks(node: OutlineNode) -> dict[str, str]:
    """Return what a page finds a node's group by."""
    return {"id": identifier(node.path), "data-path": node.path, "data-kind": node.kind}


def _said(note: Note | None) -> tuple[str, ...]:
    """Return the lines that a note takes, each short enough for a node."""
    return () if note is None else tuple("".join(fitted(line, COLUMNS)) for line in note.lines)


def _size(node: OutlineNode, shown: Card, said: Sequence[str]) -> Size:
    lines = [*shown.lines, *said]
    text = max([extent(shown.title, TITLE, bold=True), *(extent(line, LINE) for line in lines)])
    left = _text_indent(shown)
    slot = extent(node.slot, SLOT) + _AFTER_SLOT if node.slot else 0.0
    name = extent(node.subtree, NAME, bold=True) + FRAME if node.subtrees else 0.0
    return Size(left + text + _PADDING, _FIRST_LINE + _NEXT_LINE * len(lines), slot, name)


def _text_indent(shown: Card) -> float:
    return _BADGE + 12 if shown.symbol else _PADDING


def _add_frame(picture: Element, node: OutlineNode, frame: Rectangle) -> None:
    """Draw the frame around a subtree, with its name."""
    group = add(picture, "g", "subtree", **{"data-path": node.path})
    add(group, "rect", "frame", rx="12", **_bounds(frame))
    add(group, "text", "name", node.subtree, x=at(frame.x + FRAME), y=at(frame.y + 14))


def _add_line(group: Element, node: OutlineNode, source: Rectangle, target: Rectangle, trunk: float) -> None:
    """Draw the line from a node's parent, with what the node is to it."""
    course = f"M{at(source.right)} {at(source.middle)}"
    down = target.middle - source.middle
    if down >= 1:
        bend = min(_CORNER, down / 2)
        course += f"H{at(trunk - bend)}q{at(bend)} 0 {at(bend)} {at(bend)}"
        course += f"V{at(target.middle - bend)}q0 {at(bend)} {at(bend)} {at(bend)}"
    course += f"H{at(target.x)}"
    add(group, "path", "edge", d=course)
    if node.slot:
        add(group, "text", "slot", node.slot, x=at(trunk + _CORNER + 2), y=at(target.middle - 4))


def _add_box(group: Element, shown: Card, said: Sequence[str], box: Rectangle) -> None:
    """Draw a node: its box, its symbol, its text, and what is said of it."""
    add(group, "rect", "box", rx="5" if shown.symbol else "10", **_bounds(box))
    if shown.symbol:
        badge = Rectangle(box.x + 4, box.y + 4, _BADGE, _BADGE)
        add(group, "rect", "badge", rx="4", **_bounds(badge))
        add(group, "text", "symbol", shown.symbol, x=at(badge.x + _BADGE / 2), y=at(badge.y + 15))
    left, baseline = at(box.x + _text_indent(shown)), box.y + _BASELINE
    add(group, "text", "title", shown.title, x=left, y=at(baseline))
    lines = [("line", line) for line in shown.lines] + [("note", line) for line in said]
    for number, (kind, line) in enumerate(lines, 1):
        add(group, "text", kind, line, x=left, y=at(baseline + _NEXT_LINE * number))


def _bounds(rectangle: Rectangle) -> dict[str, str]:
    return {
        "x": at(rectangle.x),
        "y": at(rectangle.y),
        "width": at(rectangle.width),
        "height": at(rectangle.height),
    }
