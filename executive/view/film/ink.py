"""Colours, font and status marks of a film, and text of limited width."""

from __future__ import annotations

from functools import lru_cache

from PIL import Image, ImageDraw, ImageFont

BACK, RULE = "#14181D", "#2E3742"
"""Colours of the background and of lines."""
INK, DIM, FAINT = "#F3F6F8", "#9AA6B2", "#66727F"
"""Colours of important text, of other text, and of nodes that do not run."""
RUNNING, SUCCESS, FAILURE = "#F2A71B", "#45BD70", "#F0685C"
"""Colours of a status: those of `view/tree/tree.svg`, adapted to a dark background."""
STATUS = {"RUNNING": RUNNING, "SUCCESS": SUCCESS, "FAILURE": FAILURE}
"""Colour by status; any other status is drawn as `FAINT`."""

_OVERSAMPLING, _LINE_WIDTH = 8, 0.17
"""Factor by which marks are drawn larger and then shrunk; width of their lines [share of their size]."""
_TICK = [[(0.12, 0.54), (0.4, 0.82), (0.9, 0.22)]]
_CROSS = [[(0.17, 0.17), (0.83, 0.83)], [(0.83, 0.17), (0.17, 0.83)]]
_ELLIPSIS = "\N{HORIZONTAL ELLIPSIS}"


@lru_cache(maxsize=32)
def font(size: float) -> ImageFont.FreeTypeFont:
    """Return Pillow's own font in a size [pixel]."""
    default_font = ImageFont.load_default(size)
    assert isinstance(default_font, ImageFont.FreeTypeFont), "Pillow's wheels draw with FreeType"
    return default_font


@lru_cache(maxsize=4096)
def clip(text: str, size: float, width: float) -> str:
    """Return a text, shortened with an ellipsis to `width` [pixel]."""
    line = " ".join(text.split())
    if font(size).getlength(line) <= width:
        return line
    while line and font(size).getlength(line + _ELLIPSIS) > width:
        line = line[:-1]
    return line.rstrip() + _ELLIPSIS if line else ""


def wrap(text: str, size: float, width: float, most: int) -> list[str]:
    """Return a text in at most `most` lines of at most `width` [pixel]."""
    lines: list[str] = []
    words = text.split()
    while words and len(lines) < most - 1:
        count = max(
            (n for n in range(1, len(words) + 1) if font(size).getlength(" ".join(words[:n])) <= width),
            default=1,
        )
        lines.append(clip(" ".join(words[:count]), size, width))
        words = words[count:]
    return [*lines, clip(" ".join(words), size, width)] if words else lines


def put_mark(image: Image.Image, status: str, centre: tuple[float, float], size: int) -> None:
    """Draw the mark of a status: triangle for running, tick for success, cross for failure, dot for others.

    Args:
        image: Image to draw on.
        status: Status of a node.
        centre: Centre of the mark [pixel].
        size: Side of the square around it [pixel].
    """
    left, top = round(centre[0] - size / 2), round(centre[1] - size / 2)
    image.paste(STATUS.get(status, FAINT), (left, top, left + size, top + size), _draw_mask(status, size))


@lru_cache(maxsize=16)
def _draw_mask(status: str, size: int) -> Image.Image:
    """Return the coverage of each pixel by a mark, 0 to 255, `(size, size)`."""
    side = size * _OVERSAMPLING
    mask = Image.new("L", (side, side))
    draw = ImageDraw.Draw(mask)
    if status == "RUNNING":
        draw.polygon([(0.16 * side, 0.08 * side), (0.92 * side, 0.5 * side), (0.16 * side, 0.92 * side)], 255)
    elif status in ("SUCCESS", "FAILURE"):
        width = round(side * _LINE_WIDTH)
        for line in _TICK if status == "SUCCESS" else _CROSS:
            points = [(x * side, y * side) for x, y in line]
            draw.line(points, 255, width, joint="curve")
            for end in (points[0], points[-1]):
                draw.circle(end, width / 2, 255)
    else:
        draw.circle((side / 2, side / 2), 0.16 * side, 255)
    return mask.resize((size, size), Image.Resampling.BOX)
