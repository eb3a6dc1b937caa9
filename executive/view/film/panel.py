"""Right side of a frame: the running branch of the tree, and the items of the run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from PIL import Image, ImageDraw

from executive.cell.frame import Box
from executive.events import ItemChanged
from executive.mission.outline import OutlineNode
from executive.view.film import ink
from executive.view.film.course import FilmCourse
from executive.view.film.ink import DIM, FAILURE, FAINT, INK, RULE, RUNNING, STATUS, SUCCESS
from executive.view.tree.outline import draw_branches, select_open

TEXT_SIZE, HEADING_SIZE, MARK_SIZE = 14, 12, 11
"""Sizes of text, of column headings and of status marks [pixel]."""
NODE_ROW, ITEM_ROW, INDENT = 18, 20, 17
"""Heights of the rows of the tree and of the items, and indentation per level of the tree [pixel]."""
MAX_ITEM_ROWS = 9
"""Largest number of rows for items."""
_CHARACTERS_PER_LEVEL = 3
"""Number of characters that `draw_branches` returns per level of the tree."""
_COLUMNS = {"item": 0.0, "class": 0.32, "state": 0.53, "bin": 0.74}
"""Left ends of the columns [share of the width]."""
_STATES = {"placed": SUCCESS, "rejected": FAILURE, "lost": FAILURE, "held": RUNNING, "dropped": RUNNING}
_FINAL_STATES = ("placed", "rejected", "skipped", "lost", "phantom")
_SWATCH_SIZE = 9


def draw_branch(image: Image.Image, box: Box, nodes: Sequence[OutlineNode], course: FilmCourse) -> None:
    """Draw the open nodes of a run and their children.

    Args:
        image: Image to draw on.
        box: Left, top, right and bottom of the free area [pixel].
        nodes: The whole tree.
        course: Its open nodes, and what is known of them.
    """
    left, top, right, bottom = box
    shown = select_nodes(nodes, course, int((bottom - top) // NODE_ROW))
    draw = ImageDraw.Draw(image)
    for row, (node, branch) in enumerate(zip(shown, draw_branches(shown), strict=True)):
        middle = top + NODE_ROW * (row + 0.5)
        _draw_lines(draw, branch, left, middle)
        last = course.timeline.current(node.path)
        now = last.status if last else ""
        x = left + INDENT * (len(branch) // _CHARACTERS_PER_LEVEL)
        ink.put_mark(image, now, (x + MARK_SIZE / 2, middle), MARK_SIZE)
        x += MARK_SIZE + 8
        colour = DIM if now in ("SUCCESS", "FAILURE") else FAINT
        if now == "RUNNING":
            colour = RUNNING if node.skill else INK
        name = ink.clip(node.name, TEXT_SIZE, right - x)
        draw.text((x, middle), name, colour, ink.font(TEXT_SIZE), "lm")
        x += ink.font(TEXT_SIZE).getlength(name) + 10
        why = ink.clip(last.note if last else "", TEXT_SIZE, right - x)
        draw.text((x, middle), why, FAILURE if now == "FAILURE" else DIM, ink.font(TEXT_SIZE), "lm")


def select_nodes(nodes: Sequence[OutlineNode], course: FilmCourse, rows: int) -> list[OutlineNode]:
    """Return the open nodes and their children, at most `rows` of them.

    Nodes that never ran are left out first, then nodes that do not run; the last of the tree first.
    """
    open_paths = course.open_paths
    shown = select_open(nodes, open_paths)

    def rank(index: int) -> tuple[bool, bool, int]:
        path = shown[index].path
        last = course.timeline.current(path)
        return path in open_paths, last is not None and last.status in STATUS, -index

    kept_indices = sorted(sorted(range(len(shown)), key=rank, reverse=True)[:rows])
    return [shown[index] for index in kept_indices]


def height(items: int) -> int:
    """Return the height of a list of `items` items [pixel]."""
    return ITEM_ROW * (min(items, MAX_ITEM_ROWS) + 1)


def draw_items(image: Image.Image, box: Box, rows: Sequence[ItemChanged], bins: Mapping[str, str]) -> None:
    """Draw at most `MAX_ITEM_ROWS` items; items in a final state are left out first.

    Args:
        image: Image to draw on.
        box: Left, top, right and bottom of the free area [pixel].
        rows: The items.
        bins: Colour of each bin, by name.
    """
    left, top, right, _ = box
    draw = ImageDraw.Draw(image)
    starts = [left + share * (right - left) for share in _COLUMNS.values()]
    ends = [start - 8 for start in starts[1:]] + [right]
    for title, start in zip(_COLUMNS, starts, strict=True):
        draw.text((start, top + ITEM_ROW / 2), title, FAINT, ink.font(HEADING_SIZE), "lm")
    for number, row in enumerate(select_items(rows), start=1):
        middle = top + ITEM_ROW * (number + 0.5)
        cells = (row.item, row.label, row.state, row.bin)
        colours = (DIM if row.state in _FINAL_STATES else INK, DIM, _STATES.get(row.state, DIM), DIM)
        shifts = (0, 0, 0, _SWATCH_SIZE + 6)
        for cell, colour, shift, start, end in zip(cells, colours, shifts, starts, ends, strict=True):
            text = ink.clip(cell, TEXT_SIZE, end - start - shift)
            draw.text((start + shift, middle), text, colour, ink.font(TEXT_SIZE), "lm")
        if row.bin:
            x, y = starts[-1], round(middle) - _SWATCH_SIZE // 2
            draw.rectangle((x, y, x + _SWATCH_SIZE - 1, y + _SWATCH_SIZE - 1), bins.get(row.bin, DIM))


def select_items(rows: Sequence[ItemChanged]) -> list[ItemChanged]:
    """Return at most `MAX_ITEM_ROWS` items in their order; the first in a final state are left out first."""
    order = sorted(range(len(rows)), key=lambda index: (rows[index].state not in _FINAL_STATES, index))
    left_out = set(order[: max(len(rows) - MAX_ITEM_ROWS, 0)])
    return [row for index, row in enumerate(rows) if index not in left_out]


def _draw_lines(draw: ImageDraw.ImageDraw, branch: str, left: float, middle: float) -> None:
    """Draw the lines that join a row to the rows above and below."""
    for level in range(0, len(branch), _CHARACTERS_PER_LEVEL):
        joint = branch[level]
        x = left + INDENT * (level // _CHARACTERS_PER_LEVEL) + MARK_SIZE // 2
        if joint != " ":
            bottom = middle if joint == "└" else middle + NODE_ROW / 2
            draw.line((x, middle - NODE_ROW / 2, x, bottom), RULE, 1)
        if joint in "├└":
            draw.line((x, middle, x + INDENT - MARK_SIZE // 2 - 3, middle), RULE, 1)
