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
from executive.view.tree.outline import branches, opened

TYPE, HEAD, MARK = 14, 12, 11
"""Sizes of type, of the columns' heads and of marks [pixel]."""
NODE_ROW, ITEM_ROW, INDENT = 18, 20, 17
"""Heights of the rows of the tree and of the items, and what a level of the tree is further right [pixel]."""
MOST = 9
"""Largest number of rows for items."""
_CELL = 3
"""Characters of `branches` for a level."""
_COLUMNS = {"item": 0.0, "class": 0.32, "state": 0.53, "bin": 0.74}
"""Left sides of the columns, as shares of the width."""
_STATES = {"placed": SUCCESS, "rejected": FAILURE, "lost": FAILURE, "held": RUNNING, "dropped": RUNNING}
_SETTLED = ("placed", "rejected", "skipped", "lost", "phantom")
_SWATCH = 9


def draw_branch(image: Image.Image, box: Box, nodes: Sequence[OutlineNode], course: FilmCourse) -> None:
    """Draw the open nodes of a course and what stands directly below them.

    Args:
        image: Image to draw on.
        box: Left, top, right and bottom of the room there is [pixel].
        nodes: The whole tree.
        course: Its open nodes, and what is known of them.
    """
    left, top, right, bottom = box
    shown = fitted(nodes, course, int((bottom - top) // NODE_ROW))
    draw = ImageDraw.Draw(image)
    for row, (node, branch) in enumerate(zip(shown, branches(shown), strict=True)):
        middle = top + NODE_ROW * (row + 0.5)
        _draw_lines(draw, branch, left, middle)
        last = course.timeline.current(node.path)
        now = last.status if last else ""
        x = left + INDENT * (len(branch) // _CELL)
        ink.put_mark(image, now, (x + MARK / 2, middle), MARK)
        x += MARK + 8
        colour = DIM if now in ("SUCCESS", "FAILURE") else FAINT
        if now == "RUNNING":
            colour = RUNNING if node.skill else INK
        name = ink.clipped(node.name, TYPE, right - x)
        draw.text((x, middle), name, colour, ink.font(TYPE), "lm")
        x += ink.font(TYPE).getlength(name) + 10
        why = ink.clipped(last.note if last else "", TYPE, right - x)
        draw.text((x, middle), why, FAILURE if now == "FAILURE" else DIM, ink.font(TYPE), "lm")


def fitted(nodes: Sequence[OutlineNode], course: FilmCourse, rows: int) -> list[OutlineNode]:
    """Return the open nodes and what stands directly below them, in at most so many rows.

    What is left out first never ran, then what rests; from the end of the tree.
    """
    is_open = course.open
    shown = opened(nodes, is_open)

    def worth(index: int) -> tuple[bool, bool, int]:
        path = shown[index].path
        last = course.timeline.current(path)
        return path in is_open, last is not None and last.status in STATUS, -index

    kept = sorted(sorted(range(len(shown)), key=worth, reverse=True)[:rows])
    return [shown[index] for index in kept]


def height(items: int) -> int:
    """Return how high [pixel] the list of so many items is."""
    return ITEM_ROW * (min(items, MOST) + 1)


def draw_items(image: Image.Image, box: Box, rows: Sequence[ItemChanged], bins: Mapping[str, str]) -> None:
    """Draw the items that there is room for; what is settled gives way to what is not.

    Args:
        image: Image to draw on.
        box: Left, top, right and bottom of the room there is [pixel].
        rows: The items.
        bins: Colour of each bin, by name.
    """
    left, top, right, _ = box
    draw = ImageDraw.Draw(image)
    starts = [left + share * (right - left) for share in _COLUMNS.values()]
    ends = [start - 8 for start in starts[1:]] + [right]
    for title, start in zip(_COLUMNS, starts, strict=True):
        draw.text((start, top + ITEM_ROW / 2), title, FAINT, ink.font(HEAD), "lm")
    for number, row in enumerate(kept(rows), start=1):
        middle = top + ITEM_ROW * (number + 0.5)
        cells = (row.item, row.label, row.state, row.bin)
        colours = (DIM if row.state in _SETTLED else INK, DIM, _STATES.get(row.state, DIM), DIM)
        shifts = (0, 0, 0, _SWATCH + 6)
        for cell, colour, shift, start, end in zip(cells, colours, shifts, starts, ends, strict=True):
            text = ink.clipped(cell, TYPE, end - start - shift)
            draw.text((start + shift, middle), text, colour, ink.font(TYPE), "lm")
        if row.bin:
            x, y = starts[-1], round(middle) - _SWATCH // 2
            draw.rectangle((x, y, x + _SWATCH - 1, y + _SWATCH - 1), bins.get(row.bin, DIM))


def kept(rows: Sequence[ItemChanged]) -> list[ItemChanged]:
    """Return at most `MOST` items in their order; those settled first are left out first."""
    order = sorted(range(len(rows)), key=lambda index: (rows[index].state not in _SETTLED, index))
    left_out = set(order[: max(len(rows) - MOST, 0)])
    return [row for index, row in enumerate(rows) if index not in left_out]


def _draw_lines(draw: ImageDraw.ImageDraw, branch: str, left: float, middle: float) -> None:
    """Draw what joins a row to the rows above and below it."""
    for level in range(0, len(branch), _CELL):
        joint = branch[level]
        x = left + INDENT * (level // _CELL) + MARK // 2
        if joint != " ":
            bottom = middle if joint == "└" else middle + NODE_ROW / 2
            draw.line((x, middle - NODE_ROW / 2, x, bottom), RULE, 1)
        if joint in "├└":
            draw.line((x, middle, x + INDENT - MARK // 2 - 3, middle), RULE, 1)
