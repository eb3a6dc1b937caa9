"""The items of a run: class, state and bin, each in its column."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from PIL import Image, ImageDraw

from executive.messages import Box
from executive.view.film.ink import DIM, FAILURE, FAINT, INK, RUNNING, SUCCESS, clipped, font
from executive.view.items import Row

ROW, TYPE, HEAD = 20, 14, 12
"""Height of a row, sizes of type and of the columns' heads [pixel]."""
MOST = 9
"""Rows there are at most."""
_COLUMNS = {"item": 0.0, "class": 0.32, "state": 0.53, "bin": 0.74}
"""Where columns begin, as shares of the width."""
_STATES = {"placed": SUCCESS, "rejected": FAILURE, "lost": FAILURE, "held": RUNNING, "dropped": RUNNING}
_SETTLED = ("placed", "rejected", "lost", "phantom")
_SWATCH = 9


def height(items: int) -> int:
    """Return how high [pixel] the list of so many items is."""
    return ROW * (min(items, MOST) + 1)


def draw_items(image: Image.Image, box: Box, rows: Sequence[Row], bins: Mapping[str, str]) -> None:
    """Draw the items that there is room for; what is settled gives way to what is not.

    Args:
        image: What they are drawn on.
        box: Left, top, right and bottom of the room there is [pixel].
        rows: The items.
        bins: Colour of each bin, by name.
    """
    left, top, right, _ = box
    draw = ImageDraw.Draw(image)
    starts = [left + share * (right - left) for share in _COLUMNS.values()]
    ends = [start - 8 for start in starts[1:]] + [right]
    for title, start in zip(_COLUMNS, starts, strict=True):
        draw.text((start, top + ROW / 2), title, FAINT, font(HEAD), "lm")
    for number, row in enumerate(kept(rows), start=1):
        middle = top + ROW * (number + 0.5)
        settled = row.state in _SETTLED
        cells = (row.item, row.label, row.state, row.bin)
        colours = (DIM if settled else INK, DIM, _STATES.get(row.state, DIM), DIM)
        for cell, colour, start, end in zip(cells, colours, starts, ends, strict=True):
            x = start
            if row.bin and start == starts[-1]:
                y = round(middle) - _SWATCH // 2
                draw.rectangle((x, y, x + _SWATCH - 1, y + _SWATCH - 1), bins.get(row.bin, DIM))
                x += _SWATCH + 6
            draw.text((x, middle), clipped(cell, TYPE, end - x), colour, font(TYPE), "lm")


def kept(rows: Sequence[Row]) -> list[Row]:
    """Return at most `MOST` items in their order; those settled first are left out first."""
    surplus = len(rows) - MOST
    if surplus <= 0:
        return list(rows)
    order = sorted(range(len(rows)), key=lambda index: (rows[index].state not in _SETTLED, index))
    left_out = set(order[:surplus])
    return [row for index, row in enumerate(rows) if index not in left_out]
