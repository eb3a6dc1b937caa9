"""Texts in drawings and pages: width estimate, line breaks, templates, and the tree for a terminal."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Collection, Sequence

from jinja2 import Environment, PackageLoader, StrictUndefined
from rich.cells import cell_len

from executive.mission.grammar import USE_KEYWORD
from executive.mission.outline import Connection, OutlineNode, list_child_indices

MAX_LINE_LENGTH = 100
"""Maximum length of a line [characters]."""
_MIN_TEXT_LENGTH = 40
"""Minimum length of the text of a line after its prefix [characters]."""
_INVALID_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Pattern of the characters that XML 1.0 does not allow."""
_CELL_WIDTH = 0.64
"""Width of most characters in DejaVu Sans, the widest common sans-serif font [fraction of the font size]."""
_BOLD_FACTOR = 1.12
"""Ratio of the widths of a bold and a regular character."""


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
    environment = Environment(
        loader=PackageLoader("executive.view", "templates"), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    return replace_invalid_xml_characters(environment.get_template(template).render(values))


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
