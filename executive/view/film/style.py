"""Colours, fonts and status marks of a film, and functions that fit texts to a width."""

from __future__ import annotations

from functools import lru_cache

from PIL import Image, ImageDraw, ImageFont

BACKGROUND, LINE = "#14181D", "#2E3742"
"""Colours of the background and of lines."""
TEXT, MINOR_TEXT, INACTIVE = "#F3F6F8", "#9AA6B2", "#66727F"
"""Colours of primary text, of secondary text, and of inactive nodes."""
RUNNING, SUCCESS, FAILURE = "#F2A71B", "#45BD70", "#F0685C"
"""Colours of the statuses: those of `view/tree/tree.svg`, adapted to a dark background."""
STATUS_COLOURS = {"RUNNING": RUNNING, "SUCCESS": SUCCESS, "FAILURE": FAILURE}
"""Colour of a status mark by status; the mark of any other status has the colour `INACTIVE`."""

_OVERSAMPLING = 8
"""Factor by which a mark is drawn larger before it is scaled down for antialiasing."""
_LINE_WIDTH = 0.17
"""Width of the lines of a mark [fraction of the side of the mark]."""
_CHECK_MARK = [[(0.12, 0.54), (0.4, 0.82), (0.9, 0.22)]]
_CROSS = [[(0.17, 0.17), (0.83, 0.83)], [(0.83, 0.17), (0.17, 0.83)]]
"""Lines of the mark, as points (x, y) [fraction of the side of the mark]; y points down."""
_ELLIPSIS = "\N{HORIZONTAL ELLIPSIS}"


@lru_cache(maxsize=32)
def load_font(size: float) -> ImageFont.FreeTypeFont:
    """Return the built-in font of Pillow with a size [pixel]."""
    default_font = ImageFont.load_default(size)
    assert isinstance(default_font, ImageFont.FreeTypeFont), "Pillow's wheels draw with FreeType"
    return default_font


@lru_cache(maxsize=4096)
def truncate(text: str, size: float, width: float) -> str:
    """Return a text on one line, truncated with an ellipsis to `width` [pixel]; `size` is the font size."""
    line = " ".join(text.split())
    if load_font(size).getlength(line) <= width:
        return line
    while line and load_font(size).getlength(line + _ELLIPSIS) > width:
        line = line[:-1]
    return line.rstrip() + _ELLIPSIS if line else ""


def wrap(text: str, size: float, width: float, max_lines: int) -> list[str]:
    """Return a text as at most `max_lines` lines of at most `width` [pixel]; the last line is truncated."""
    lines: list[str] = []
    words = text.split()
    while words and len(lines) < max_lines - 1:
        count = max(
            (n for n in range(1, len(words) + 1) if load_font(size).getlength(" ".join(words[:n])) <= width),
            default=1,
        )
        lines.append(truncate(" ".join(words[:count]), size, width))
        words = words[count:]
    return [*lines, truncate(" ".join(words), size, width)] if words else lines


def draw_mark(image: Image.Image, status: str, centre: tuple[float, float], size: int) -> None:
    """Draw a status mark: a triangle for RUNNING, a check mark for SUCCESS, a cross for FAILURE, else a dot.

    Args:
        image: Image to draw on.
        status: Status of a node, or "" for a node that never ran.
        centre: Centre of the mark [pixel].
        size: Side of the square around the mark [pixel].
    """
    left, top = round(centre[0] - size / 2), round(centre[1] - size / 2)
    box = (left, top, left + size, top + size)
    image.paste(STATUS_COLOURS.get(status, INACTIVE), box, _draw_mask(status, size))


@lru_cache(maxsize=16)
def _draw_mask(status: str, size: int) -> Image.Image:
    """Return the coverage of each pixel by the mark of a status, 0 to 255, `(size, size)`."""
    side = size * _OVERSAMPLING
    mask = Image.new("L", (side, side))
    draw = ImageDraw.Draw(mask)
    if status == "RUNNING":
        draw.polygon([(0.16 * side, 0.08 * side), (0.92 * side, 0.5 * side), (0.16 * side, 0.92 * side)], 255)
    elif status in ("SUCCESS", "FAILURE"):
        width = round(side * _LINE_WIDTH)
        for line in _CHECK_MARK if status == "SUCCESS" else _CROSS:
            points = [(x * side, y * side) for x, y in line]
            draw.line(points, 255, width, joint="curve")
            for end in (points[0], points[-1]):
                draw.circle(end, width / 2, 255)
    else:
        draw.circle((side / 2, side / 2), 0.16 * side, 255)
    return mask.resize((size, size), Image.Resampling.BOX)
