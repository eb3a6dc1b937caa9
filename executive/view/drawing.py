"""Drawings of a tree: lines for a terminal, and an SVG document; line breaks and templates of displays.

The SVG document needs no other files. Each node is a group of the class `node`. To show the status of a
node, a page adds the class `running`, `success` or `failure` to its group. A page may also move the group to
the end of the document, so that the line to the node is drawn above other lines. The background is
transparent; a page may be light or dark.

The nodes of one depth form a column. Each node has a horizontal band that contains its box and the bands of
its children, so that boxes cannot overlap. A frame encloses each subtree, within the band of the first node
of the subtree. A node and its first child are at the same height.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

from jinja2 import Environment, PackageLoader, StrictUndefined
from rich.cells import cell_len

from executive.mission.grammar import USE_KEYWORD
from executive.mission.outline import Connection, OutlineNode, list_child_indices
from executive.tree.node import ControlNode

MAX_LINE_LENGTH = 100
"""Maximum length of a line on a terminal [characters]."""
_MIN_TEXT_LENGTH = 40
"""Minimum length of the text of a line after its prefix [characters]."""
_INVALID_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Pattern of the characters that XML 1.0 does not allow."""
_CELL_WIDTH = 0.64
"""Width of most characters in DejaVu Sans, the widest common sans-serif font [fraction of the font size]."""
_BOLD_FACTOR = 1.12
"""Ratio of the widths of a bold and a regular character."""
MAX_BOX_LINE_LENGTH = 28
"""Maximum length of a line of text in the box of a node [characters]."""
MARGIN = 16.0
"""Margin of the picture [pixel]."""
NODE_GAP = 10.0
"""Vertical distance between the boxes of nodes [pixel]."""
EDGE_SEGMENT_LENGTH = 16.0
"""Length of each horizontal part of the line between a node and its child [pixel]."""
FRAME_PADDING = 9.0
"""Distance between a frame and the boxes in the frame [pixel]."""
FRAME_HEADER = 20.0
"""Height of the part of a frame that contains the name of the subtree [pixel]."""

TITLE_SIZE = 13.0
LINE_SIZE = 11.0
SUBTREE_NAME_SIZE = 12.0
"""Font sizes of titles, of lines and labels of edges, and of names of subtrees; see `tree.svg` [pixel]."""
_INVALID_IN_ID = re.compile(r"[^A-Za-z0-9_/]")
"""Pattern of the characters of a path that are escaped in the id of an SVG element."""
_BOX_PADDING = 11.0
"""Distance between the texts and the sides of a box without a symbol [pixel]."""
_SYMBOL_WIDTH = 32.0
"""Width of a symbol with its margins [pixel]."""
_EDGE_LABEL_GAP = 4.0
"""Gap after the label of an edge [pixel]."""
_TITLE_HEIGHT = 28.0
_LINE_HEIGHT = 14.0
"""Heights of the title and of another line in the box of a node [pixel]."""
_MAX_CORNER_RADIUS = 6.0
"""Maximum radius of the rounded corners of an edge [pixel]."""


def estimate_text_width(text: str, font_size: float, *, bold: bool = False) -> float:
    """Return the approximate width [pixel] of a text in a sans-serif font of `font_size` [pixel]."""
    return cell_len(text) * _CELL_WIDTH * font_size * (_BOLD_FACTOR if bold else 1.0)


def wrap_and_truncate(text: str, max_length: int, max_lines: int = 1) -> tuple[str, ...]:
    """Return a text as at most `max_lines` lines of at most `max_length` characters.

    Lines are broken after commas if possible. An ellipsis `…` replaces text beyond the last line.
    """
    lines: list[str] = []
    for clause in " ".join(text.split()).replace(", ", ",\n").splitlines():
        if lines and len(lines[-1]) + len(clause) < max_length:
            lines[-1] += f" {clause}"
        else:
            lines += textwrap.wrap(clause, max_length, break_on_hyphens=False)
    if len(lines) > max_lines:
        line = lines[max_lines - 1]
        last_line = f"{line} …" if len(line) + 2 <= max_length else f"{line[: max_length - 1]}…"
        lines[max_lines - 1 :] = [last_line]
    return tuple(lines)


def replace_invalid_xml_characters(text: str) -> str:
    """Return a text in which `�` replaces all characters that XML does not allow."""
    return _INVALID_IN_XML.sub("�", text)


def render_template(template: str, **values: object) -> str:
    """Return a rendered template; escape texts, and replace characters that XML does not allow.

    `template` is the path of the template file, relative to `executive/view`.
    """
    return replace_invalid_xml_characters(_make_environment().get_template(template).render(values))


@cache
def _make_environment() -> Environment:
    """Return the environment of all templates; cached, because it keeps the compiled templates."""
    return Environment(
        loader=PackageLoader("executive.view", "templates"), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip


def draw_text(nodes: Sequence[OutlineNode], *, shows_ports: bool = False, shows_reasons: bool = False) -> str:
    """Return the drawing of a tree as a text, with one line per node unless the line is too long.

    Args:
        nodes: Nodes of the tree.
        shows_ports: True to write the variables of a skill below the skill.
        shows_reasons: True to write the failure reasons of skills and catches below the node.
    """
    lines = []
    prefixes = draw_line_prefixes(nodes)
    for node, prefix, children in zip(nodes, prefixes, list_child_indices(nodes), strict=True):
        # Only the vertical strokes of the prefix continue in the lines below the name of the node.
        indent = prefix.replace("├─", "│ ").replace("└─", "  ") + ("│  " if children else "   ")
        detail = f"  ({node.detail})" if node.detail else ""
        lines += _wrap_line(f"{node.name}{detail}", prefix, indent)
        details = [node.trigger] if shows_reasons else []
        details += ["; ".join(describe_connections(node))] if shows_ports else []
        details += [describe_reasons(node)] if shows_reasons else []
        for text in filter(None, details):
            lines += _wrap_line(text, indent, indent)
    return "\n".join(lines)


def draw_line_prefixes(nodes: Sequence[OutlineNode]) -> list[str]:
    """Return a prefix for the line of each node: box-drawing characters, three per depth."""
    prefixes = []
    # The nodes are visited from the last to the first. The set contains the depth of each node that has been
    # visited and whose parent has not.
    sibling_depths: set[int] = set()
    for node in reversed(nodes):
        sibling_depths = {depth for depth in sibling_depths if depth <= node.depth}
        prefix = "".join("│  " if depth in sibling_depths else "   " for depth in range(1, node.depth))
        if node.depth > 0:
            prefix += "├─ " if node.depth in sibling_depths else "└─ "
        prefixes.append(prefix)
        sibling_depths.add(node.depth)
    return prefixes[::-1]


def _wrap_line(text: str, first_indent: str, indent: str) -> list[str]:
    """Return the lines of a wrapped text; `first_indent` precedes the first line, `indent` all others."""
    return textwrap.wrap(
        text, max(MAX_LINE_LENGTH, len(indent) + _MIN_TEXT_LENGTH), initial_indent=first_indent,
        subsequent_indent=f"{indent}  ", break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip


def describe_connections(node: OutlineNode) -> list[str]:
    """Return the texts about the variables that a skill reads and that it writes, without empty texts."""
    texts = _format_variables("reads", node.reads, "<-"), _format_variables("writes", node.writes, "->")
    return list(filter(None, texts))


def _format_variables(verb: str, connections: Sequence[Connection], arrow: str) -> str:
    """Return a text with the variables (`?` for optional), and the ports whose name differs; "" for none."""
    texts = []
    for connection in connections:
        variable = f"${connection.variable}" + ("" if connection.required else "?")
        has_same_name = connection.port == connection.variable
        texts.append(variable if has_same_name else f"{connection.port} {arrow} {variable}")
    return f"{verb} {', '.join(texts)}" if texts else ""


def describe_reasons(node: OutlineNode) -> str:
    """Return a text with the failure reasons of a skill; "" for none."""
    return f"may fail: {', '.join(node.reasons)}" if node.reasons else ""


def fold_subtrees(nodes: Sequence[OutlineNode]) -> list[OutlineNode]:
    """Return the nodes of a tree, with a single node in place of each repetition of a subtree."""
    folded_nodes: list[OutlineNode] = []
    content_by_subtree: dict[str, list[tuple[int, str, str]]] = {}
    index = 0
    while index < len(nodes):
        node = nodes[index]
        end = index + 1
        while end < len(nodes) and nodes[end].depth > node.depth:
            end += 1
        content = [(each.depth - node.depth, each.title, each.detail) for each in nodes[index:end]]
        repeated_subtree = next((subtree for subtree in node.subtrees if subtree in content_by_subtree), None)
        if repeated_subtree is None:
            content_by_subtree |= dict.fromkeys(node.subtrees, content)
            folded_nodes.append(node)
            index += 1
        else:
            # Two uses of a subtree may have different params, and therefore different titles and details.
            is_equal = content_by_subtree[repeated_subtree] == content
            detail = "as above" if is_equal else "as above, other params"
            outer_subtrees = node.subtrees[: node.subtrees.index(repeated_subtree)]
            use_node = OutlineNode(
                node.path, node.name, node.depth, detail, USE_KEYWORD, repeated_subtree, node.parent_key,
                node.trigger, outer_subtrees, symbol="…",
            )  # fmt: skip
            folded_nodes.append(use_node)
            index = end
    return folded_nodes


def select_active_nodes(nodes: Sequence[OutlineNode], running_paths: Collection[str]) -> list[OutlineNode]:
    """Return the root and all children of running nodes, given the paths of the running nodes."""
    active_nodes = []
    # The list contains for each ancestor of the current node, from the root down, whether it is running.
    are_ancestors_running: list[bool] = []
    for node in nodes:
        del are_ancestors_running[node.depth :]
        if all(are_ancestors_running):
            active_nodes.append(node)
        are_ancestors_running.append(node.path in running_paths)
    return active_nodes


@dataclass(frozen=True)
class NodeResult:
    """Result of a node in a run, for the drawing of the node.

    Attributes:
        status: `RUNNING`, `SUCCESS`, `FAILURE` or `INVALID`; "" for a node that never ran.
        lines: Lines of text below the settings of the node; the drawing truncates long lines.
    """

    status: str = ""
    lines: tuple[str, ...] = ()


@dataclass(eq=False)
class NodeBox:
    """Box of a node in the picture [pixel]; y points down.

    Attributes:
        depth: Depth of the node; 0 for the root.
        width, height: Size of the box.
        label_width: Width of the label of the line to the node; 0 for no label.
        subtree_name_width: Width of the name of the subtree that starts at the node; 0 if none starts there.
        children: Boxes of the children.
        x: The x of the left side.
        edge_x: The x of the vertical part of the line to the node.
        right_end: The x of the right end of the node with its descendants and their frames.
        band_top, band_height: The y of the top of the band, and its height.
        middle_offset: Distance from the top of the band to the middle of the box.
        edge: SVG path of the line from the parent; "" for the root.
    """

    depth: int
    width: float
    height: float
    label_width: float = 0.0
    subtree_name_width: float = 0.0
    children: Sequence[NodeBox] = ()
    x: float = 0.0
    edge_x: float = 0.0
    right_end: float = 0.0
    band_top: float = 0.0
    band_height: float = 0.0
    middle_offset: float = 0.0
    edge: str = ""

    @property
    def middle_y(self) -> float:
        """The y of the middle of the box."""
        return self.band_top + self.middle_offset

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Left side, top, width and height of the box."""
        return self.x, self.middle_y - self.height / 2, self.width, self.height

    @property
    def frame(self) -> tuple[float, float, float, float]:
        """Left side, top, width and height of the frame of the subtree that starts at the node."""
        width = self.right_end - self.x + FRAME_PADDING
        return self.x - FRAME_PADDING, self.band_top + NODE_GAP / 2, width, self.band_height - NODE_GAP


@dataclass(frozen=True)
class _NodeDrawing:
    """Box of a node, and the texts in the box.

    Attributes:
        node: The node.
        status: Status of the node in a run in lower case, or "".
        symbol: Symbol before the title of a control node; "" for a skill.
        title: Name of the node, truncated to `MAX_BOX_LINE_LENGTH`.
        lines: CSS class and text of each line below the title: settings of the node, and notes on its result.
        tooltip: All information about the node, with one line per topic.
        indent: Distance between the texts and the left side of the box [pixel].
        box: Box of the node.
    """

    node: OutlineNode
    status: str
    symbol: str
    title: str
    lines: Sequence[tuple[str, str]]
    tooltip: str
    indent: float
    box: NodeBox


def make_svg(
    nodes: Sequence[OutlineNode], name: str, results: Mapping[str, NodeResult] = MappingProxyType({})
) -> str:
    """Return the drawing of a tree as an SVG document.

    `name` is the name of the mission, for the title; `results` contains results of nodes, by path.
    """
    drawings = [_make_drawing(node, results.get(node.path, NodeResult())) for node in nodes]
    boxes = [drawing.box for drawing in drawings]
    for box, indices in zip(boxes, list_child_indices(nodes), strict=True):
        box.children = [boxes[index] for index in indices]
    width, height = place_boxes(boxes)
    return render_template(
        "tree.svg", name=name, width=width, height=height, drawings=drawings, make_group_id=make_group_id
    )


def _make_drawing(node: OutlineNode, result: NodeResult) -> _NodeDrawing:
    symbol = "" if node.kind == "skill" else node.symbol or ControlNode.symbol
    title = _truncate(node.title)
    trigger_lines = wrap_and_truncate(node.trigger, MAX_BOX_LINE_LENGTH, 2)
    detail_lines = wrap_and_truncate(node.detail, MAX_BOX_LINE_LENGTH, 3 if symbol else 2)
    lines = [("line", line) for line in trigger_lines + detail_lines]
    lines += [("note", _truncate(line)) for line in result.lines]
    tooltip = "\n".join(filter(None, (*_list_tooltip_lines(node), *result.lines)))
    indent = _SYMBOL_WIDTH if symbol else _BOX_PADDING
    widths = [estimate_text_width(line, LINE_SIZE) for _, line in lines]
    widths.append(estimate_text_width(title, TITLE_SIZE, bold=True))
    label = node.parent_key
    subtree = node.joined_subtrees
    box = NodeBox(
        depth=node.depth,
        width=indent + max(widths) + _BOX_PADDING,
        height=_TITLE_HEIGHT + _LINE_HEIGHT * len(lines),
        label_width=estimate_text_width(label, LINE_SIZE) + _EDGE_LABEL_GAP if label else 0.0,
        subtree_name_width=(
            estimate_text_width(subtree, SUBTREE_NAME_SIZE, bold=True) + FRAME_PADDING if subtree else 0.0
        ),
    )
    return _NodeDrawing(node, result.status.lower(), symbol, title, lines, tooltip, indent, box)


def make_group_id(path: str) -> str:
    """Return the id of a node's group: its path with `-` for `/`, and `--<hex>-` for invalid characters."""
    return "node-" + _INVALID_IN_ID.sub(lambda match: f"--{ord(match[0]):x}-", path).replace("/", "-")


def _list_tooltip_lines(node: OutlineNode) -> Sequence[str]:
    """Return all information about a node; the most important line is the first."""
    type_name = node.skill or node.kind
    return (
        node.title if node.title == type_name else f"{node.title}: {type_name}",
        node.doc,
        node.trigger,
        node.detail,
        *describe_connections(node),
        describe_reasons(node),
        f"subtree {node.joined_subtrees}" if node.subtrees else "",
        node.path,
    )


def _truncate(text: str) -> str:
    return "".join(wrap_and_truncate(text, MAX_BOX_LINE_LENGTH))


def place_boxes(boxes: Sequence[NodeBox]) -> tuple[float, float]:
    """Set the positions of the boxes of a tree, parents before their children; return width and height."""
    _place_columns(boxes)
    for box in reversed(boxes):
        _measure_branch(box)
    root = boxes[0]
    root.band_top = MARGIN - NODE_GAP / 2
    for box in boxes:
        band_top = box.middle_y - _get_first_offset(box)
        for child in box.children:
            child.band_top = band_top
            child.edge = _draw_edge(box, child)
            band_top += child.band_height
    return root.right_end + MARGIN, root.band_top + root.band_height + MARGIN - NODE_GAP / 2


def _place_columns(boxes: Sequence[NodeBox]) -> None:
    """Set the x of each box, and of the vertical part of the line to the box."""
    right_x = 0.0
    for depth in range(max(box.depth for box in boxes) + 1):
        column = [box for box in boxes if box.depth == depth]
        edge_x = right_x + EDGE_SEGMENT_LENGTH if depth else MARGIN
        edge_length = EDGE_SEGMENT_LENGTH + max(box.label_width for box in column) if depth else 0.0
        padding = FRAME_PADDING if any(box.subtree_name_width for box in column) else 0.0
        for box in column:
            box.edge_x = edge_x
            box.x = edge_x + edge_length + padding
        right_x = column[0].x + max(box.width for box in column)


def _measure_branch(box: NodeBox) -> None:
    """Set the right end and the band of a box whose children have been measured."""
    first_offset = _get_first_offset(box)
    half_height = (box.height + NODE_GAP) / 2
    children_height = sum(child.band_height for child in box.children)
    box.middle_offset = max(half_height, first_offset)
    box.band_height = box.middle_offset + max(half_height, children_height - first_offset)
    box.right_end = max([box.x + box.width, *(child.right_end for child in box.children)])
    if box.subtree_name_width:
        box.middle_offset += FRAME_HEADER
        box.band_height += FRAME_HEADER + FRAME_PADDING
        box.right_end = max(box.right_end + FRAME_PADDING, box.x + box.subtree_name_width)


def _get_first_offset(box: NodeBox) -> float:
    """Return the middle offset of the first child, whose middle has the same y as the middle of `box`."""
    return box.children[0].middle_offset if box.children else 0.0


def _draw_edge(parent: NodeBox, child: NodeBox) -> str:
    """Return the SVG path of the line between two boxes.

    The line runs to the right (command H), around a corner (q) down (V), and around a corner to the right.
    """
    path = f"M{parent.x + parent.width:.0f} {parent.middle_y:.0f}"
    height = child.middle_y - parent.middle_y
    if height >= 1:
        radius = min(_MAX_CORNER_RADIUS, height / 2)
        path += f"H{child.edge_x - radius:.0f}q{radius:.0f} 0 {radius:.0f} {radius:.0f}"
        path += f"V{child.middle_y - radius:.0f}q0 {radius:.0f} {radius:.0f} {radius:.0f}"
    return f"{path}H{child.x:.0f}"
