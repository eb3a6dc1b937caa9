"""A frame of a film: the cell on the left, what the executive makes of it on the right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from executive.mission.outline import OutlineNode
from executive.view.film import listing
from executive.view.film.branch import draw_branch
from executive.view.film.course import Course
from executive.view.film.ink import BACK, DIM, INK, RULE, RUNNING, clipped, font
from executive.view.film.listing import draw_items
from executive.view.film.stage import STAGE, dress

WIDTH, HEIGHT = 1280, 720
"""Size of a frame [pixel]."""
LEFT, RIGHT = STAGE[0] + 28, WIDTH - 28
"""Where the panel's text begins and ends [pixel]."""
_TITLE, _NOTE = 26, 14
_TREE_TOP, _MARGIN = 122, 22


@dataclass(frozen=True)
class Book:
    """What stays the same on every page.

    Attributes:
        title: What the film is about.
        note: What else there is to know: seed, cell, speed.
        nodes: The tree.
        items: Items of the whole run, which decide how much room their list has.
        bins: Colour of each bin, by name.
        length: Time on the robot's clock in all [s].
    """

    title: str
    note: str
    nodes: Sequence[OutlineNode]
    items: int
    bins: Mapping[str, str]
    length: float


def draw_page(
    book: Book, picture: NDArray[np.uint8], course: Course, clock: float, *, caption: bool = True
) -> Image.Image:
    """Return the page that shows a run as `course` has it, `clock` [s] on the robot's clock.

    Args:
        book: What stays the same.
        picture: What the world looks like then, of the size `STAGE`.
        course: What was done and decided so far.
        clock: Time on the robot's clock [s].
        caption: Say below the picture what the robot does.
    """
    page = Image.new("RGB", (WIDTH, HEIGHT), BACK)
    page.paste(dress(picture, course, caption), (0, 0))
    _draw_head(page, book, clock)
    top = HEIGHT - _MARGIN - listing.height(book.items)
    ImageDraw.Draw(page).line((LEFT, top - 10, RIGHT, top - 10), RULE, 1)
    draw_items(page, (LEFT, top, RIGHT, HEIGHT), course.items, book.bins)
    draw_branch(page, (LEFT, _TREE_TOP, RIGHT, top - 18), book.nodes, course)
    return page


def _draw_head(page: Image.Image, book: Book, clock: float) -> None:
    """Draw what it is about, and how far it is."""
    draw = ImageDraw.Draw(page)
    time = f"{clock:.1f} s"
    room = RIGHT - LEFT - font(_TITLE).getlength(f"{book.length:.1f} s") - 24
    draw.text((LEFT, 50), clipped(book.title, _TITLE, room), INK, font(_TITLE), "ls")
    draw.text((RIGHT, 50), time, INK, font(_TITLE), "rs")
    draw.text((LEFT, 76), clipped(book.note, _NOTE, RIGHT - LEFT), DIM, font(_NOTE), "ls")
    share = clock / book.length if book.length else 1.0
    draw.rectangle((LEFT, 94, RIGHT, 96), RULE)
    draw.rectangle((LEFT, 94, LEFT + round(share * (RIGHT - LEFT)), 96), RUNNING)
