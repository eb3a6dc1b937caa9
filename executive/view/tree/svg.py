"""A tree as a picture: one SVG that needs nothing else, for a page as for a file.

Every node is a group with the class `node`; a page shows how it fares by giving it one more, `running`,
`success` or `failure`, and raises its line above its siblings' by appending the group once more. What is
behind the picture, light or dark, shines through.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from executive.mission.outline import OutlineNode, children
from executive.view.tree.card import Card, card
from executive.view.tree.layout import FRAME, Layout, Rectangle, Size, layout
from executive.view.tree.style import LINE, NAME, SLOT, STYLE, TITLE
from executive.view.tree.text import extent, writable

_NOT_ID = re.compile(r"[^A-Za-z0-9_/]")
_PADDING = 11.0
_BADGE = 20.0
_FIRST_LINE = 28.0
_NEXT_LINE = 14.0
_BASELINE = 18.5
_CORNER = 6.0
_AFTER_SLOT = 4.0


def svg(nodes: Sequence[OutlineNode], name: str) -> str:
    """Return the picture of a tree as an SVG document; `name` is the mission's, for its title."""
    below = children(nodes)
    cards = [card(node) for node in nodes]
    sizes = [_size(node, shown) for node, shown in zip(nodes, cards, strict=True)]
    plan = layout([node.depth for node in nodes], below, sizes)
    parents = {child: parent for parent, among in enumerate(below) for child in among}
    picture = Element("svg", _canvas(plan))
    _add(picture, "title", text=name)
    _add(picture, "style", text=STYLE)
    for index, frame in plan.frames.items():
        _add_frame(picture, nodes[index], frame)
    for index, (node, shown) in enumerate(zip(nodes, cards, strict=True)):
        kinds = "node skill" if node.kind == "skill" else f"node control {node.kind}"
        group = _add(picture, "g", kinds, **_marks(node))
        _add(group, "title", text=shown.tooltip)
        if index in parents:
            parent = plan.boxes[parents[index]]
            _add_line(group, node, parent, plan.boxes[index], plan.trunks[node.depth])
        _add_box(group, shown, plan.boxes[index])
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


def _size(node: OutlineNode, shown: Card) -> Size:
    text = max([extent(shown.title, TITLE, bold=True), *(extent(line, LINE) for line in shown.lines)])
    left = _text_indent(shown)
    slot = extent(node.slot, SLOT) + _AFTER_SLOT if node.slot else 0.0
    name = extent(node.subtree, NAME, bold=True) + FRAME if node.subtrees else 0.0
    return Size(left + text + _PADDING, _FIRST_LINE + _NEXT_LINE * len(shown.lines), slot, name)


def _text_indent(shown: Card) -> float:
    return _BADGE + 12 if shown.symbol else _PADDING


def _add_frame(picture: Element, node: OutlineNode, frame: Rectangle) -> None:
    """Draw the frame around a subtree, with its name."""
    group = _add(picture, "g", "subtree", **{"data-path": node.path})
    _add(group, "rect", "frame", rx="12", **_bounds(frame))
    _add(group, "text", "name", node.subtree, x=_at(frame.x + FRAME), y=_at(frame.y + 14))


def _add_line(group: Element, node: OutlineNode, source: Rectangle, target: Rectangle, trunk: float) -> None:
    """Draw the line from a node's parent, with what the node is to it."""
    course = f"M{_at(source.right)} {_at(source.middle)}"
    down = target.middle - source.middle
    if down >= 1:
        bend = min(_CORNER, down / 2)
        course += f"H{_at(trunk - bend)}q{_at(bend)} 0 {_at(bend)} {_at(bend)}"
        course += f"V{_at(target.middle - bend)}q0 {_at(bend)} {_at(bend)} {_at(bend)}"
    course += f"H{_at(target.x)}"
    _add(group, "path", "edge", d=course)
    if node.slot:
        _add(group, "text", "slot", node.slot, x=_at(trunk + _CORNER + 2), y=_at(target.middle - 4))


def _add_box(group: Element, shown: Card, box: Rectangle) -> None:
    """Draw a node: its box, its symbol, its text."""
    _add(group, "rect", "box", rx="5" if shown.symbol else "10", **_bounds(box))
    if shown.symbol:
        badge = Rectangle(box.x + 4, box.y + 4, _BADGE, _BADGE)
        _add(group, "rect", "badge", rx="4", **_bounds(badge))
        _add(group, "text", "symbol", shown.symbol, x=_at(badge.x + _BADGE / 2), y=_at(badge.y + 15))
    left, baseline = _at(box.x + _text_indent(shown)), box.y + _BASELINE
    _add(group, "text", "title", shown.title, x=left, y=_at(baseline))
    for number, line in enumerate(shown.lines, 1):
        _add(group, "text", "line", line, x=left, y=_at(baseline + _NEXT_LINE * number))


def _add(parent: Element, tag: str, kind: str = "", text: str = "", **attributes: str) -> Element:
    """Add an element of a kind, which is its class in the style sheet, and return it."""
    if kind:
        attributes["class"] = kind
    element = SubElement(parent, tag, {key: writable(value) for key, value in attributes.items()})
    element.text = writable(text) or None
    return element


def _bounds(rectangle: Rectangle) -> dict[str, str]:
    return {
        "x": _at(rectangle.x),
        "y": _at(rectangle.y),
        "width": _at(rectangle.width),
        "height": _at(rectangle.height),
    }


def _at(length: float) -> str:
    return f"{length:.0f}"
