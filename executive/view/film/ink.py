"""Colours, type and marks of a film, and text that stays within its width."""

from __future__ import annotations

from functools import lru_cache

from PIL import Image, ImageDraw, ImageFont

BACK, RULE = "#14181D", "#2E3742"
"""Colours behind everything, and of lines."""
INK, DIM, FAINT = "#F3F6F8", "#9AA6B2", "#66727F"
"""Colours of text: what is looked at, what is read, what is at rest."""
RUNNING, SUCCESS, FAILURE = "#F2A71B", "#45BD70", "#F0685C"
"""Colours of a status, those of `executive.view.tree.style` as they show on a dark ground."""
STATUS = {"RUNNING": RUNNING, "SUCCESS": SUCCESS, "FAILURE": FAILURE}
"""Colour by status; a node of another one rests."""

_FINE, _WIDTH = 8, 0.17
"""Factor by which marks are drawn larger and then shrunk; width of their lines [share of their size]."""
_TICK = [[(0.12, 0.54), (0.4, 0.82), (0.9, 0.22)]]
_CROSS = [[(0.17, 0.17), (0.83, 0.83)], [(0.83, 0.17), (0.17, 0.83)]]
_ELLIPSIS = "\N{HORIZONTAL ELLIPSIS}"


@lru_cache(maxsize=32)
def font(size: float) -> ImageFont.FreeTypeFont:
    """Return the type of that size [pixel]; it comes with Pillow, whatever else is installed."""
    found = ImageFont.load_default(size)
    assert isinstance(found, ImageFont.FreeTypeFont), "Pillow's wheels draw with FreeType"
    return found


@lru_cache(maxsize=4096)
def clipped(text: str, size: float, width: float) -> str:
    """Return a text, its end left out where it is wider than `width` [pixel]."""
    line = " ".join(text.split())
    if font(size).getlength(line) <= width:
        return line
    while line and font(size).getlength(line + _ELLIPSIS) > width:
        line = line[:-1]
    return line.rstrip() + _ELLIPSIS if line else ""


def wrapped(text: str, size: float, width: float, most: int) -> list[str]:
    """Return a text in at most so many lines, none wider than `width` [pixel]."""
    lines: list[str] = []
    words = text.split()
    while words and len(lines) < most - 1:
        count = max(
            (n for n in range(1, len(words) + 1) if font(size).getlength(" ".join(words[:n])) <= width),
            default=1,
        )
        lines.append(clipped(" ".join(words[:count]), size, width))
        words = words[count:]
    return [*lines, clipped(" ".join(words), size, width)] if words else lines


def put_mark(image: Image.Image, status: str, centre: tuple[float, float], size: int) -> None:
    """Draw the mark of a status: a triangle runs, a tick succeeded, a cross failed, a dot rests.

    Args:
        image: Image to draw on.
        status: Status of a node.
        centre: Centre of the mark [pixel].
        size: Side of the square around it [pixel].
    """
    left, top = round(centre[0] - size / 2), round(centre[1] - size / 2)
    image.paste(STATUS.get(status, FAINT), (left, top, left + size, top + size), _mark(status, size))


@lru_cache(maxsize=16)
def _mark(status: str, size: int) -> Image.Image:
    """Return how much of each pixel a mark covers, `(size, size)`."""
    side = size * _FINE
    mask = Image.new("L", (side, side))
    draw = ImageDraw.Draw(mask)
    if status == "RUNNING":
        draw.polygon([(0.16 * side, 0.08 * side), (0.92 * side, 0.5 * side), (0.16 * side, 0.92 * side)], 255)
    elif status in ("SUCCESS", "FAILURE"):
        width = round(side * _WIDTH)
        for line in _TICK if status == "SUCCESS" else _CROSS:
            points = [(x * side, y * side) for x, y in line]
            draw.line(points, 255, width, joint="curve")
            for end in (points[0], points[-1]):
                draw.circle(end, width / 2, 255)
    else:
        draw.circle((side / 2, side / 2), 0.16 * side, 255)
    return mask.resize((size, size), Image.Resampling.BOX)
