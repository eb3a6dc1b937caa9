"""The running branch of the tree, as high as there is room for."""

from __future__ import annotations

from collections.abc import Sequence

from PIL import Image, ImageDraw

from executive.messages import Box
from executive.mission.outline import OutlineNode
from executive.view.film.course import Course
from executive.view.film.ink import DIM, FAILURE, FAINT, INK, RULE, RUNNING, STATUS, clipped, font
from executive.view.film.marks import put_mark
from executive.view.tree.outline import branches, opened

ROW, INDENT, TYPE, MARK = 18, 17, 14, 11
"""Height of a row, what a level is further right, sizes of type and marks [pixel]."""
_CELL = 3
"""Characters of `branches` for a level."""


def draw_branch(
    image: Image.Image,
    box: Box,
    nodes: Sequence[OutlineNode],
    course: Course,
) -> None:
    """Draw the open nodes of a course and what stands directly below them.

    Args:
        image: What it is drawn on.
        box: Left, top, right and bottom of the room there is [pixel].
        nodes: The whole tree.
        course: Which of its nodes are open, and what is known of them.
    """
    left, top, right, bottom = box
    shown = fitted(nodes, course, int((bottom - top) // ROW))
    draw = ImageDraw.Draw(image)
    for row, (node, branch) in enumerate(zip(shown, branches(shown), strict=True)):
        middle = top + ROW * (row + 0.5)
        _draw_lines(draw, branch, left, middle)
        now = course.status.get(node.path, "")
        x = left + INDENT * (len(branch) // _CELL)
        put_mark(image, now, (x + MARK / 2, middle), MARK)
        x += MARK + 8
        name = clipped(node.name, TYPE, right - x)
        draw.text((x, middle), name, _colour(node, now), font(TYPE), "lm")
        x += font(TYPE).getlength(name) + 10
        why = clipped(course.beside.get(node.path, ""), TYPE, right - x)
        draw.text((x, middle), why, FAILURE if now == "FAILURE" else DIM, font(TYPE), "lm")


def fitted(nodes: Sequence[OutlineNode], course: Course, rows: int) -> list[OutlineNode]:
    """Return the open nodes and what stands directly below them, in at most so many rows.

    What is left out first never ran, then what rests; from the end of the tree.
    """
    is_open = course.open
    shown = opened(nodes, is_open)

    def worth(index: int) -> tuple[bool, bool, int]:
        path = shown[index].path
        return path in is_open, course.status.get(path) in STATUS, -index

    kept = sorted(sorted(range(len(shown)), key=worth, reverse=True)[:rows])
    return [shown[index] for index in kept]


def _colour(node: OutlineNode, status: str) -> str:
    if status == "RUNNING":
        return RUNNING if node.skill else INK
    return DIM if status in ("SUCCESS", "FAILURE") else FAINT


def _draw_lines(draw: ImageDraw.ImageDraw, branch: str, left: float, middle: float) -> None:
    """Draw what joins a row to the rows above and below it."""
    for level in range(0, len(branch), _CELL):
        joint = branch[level]
        x = left + INDENT * (level // _CELL) + MARK // 2
        if joint != " ":
            draw.line((x, middle - ROW / 2, x, middle if joint == "└" else middle + ROW / 2), RULE, 1)
        if joint in "├└":
            draw.line((x, middle, x + INDENT - MARK // 2 - 3, middle), RULE, 1)
