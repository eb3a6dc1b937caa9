"""Colours, fonts and status marks of a film, and functions that fit texts to a width."""

from __future__ import annotations

from functools import lru_cache

from PIL import Image, ImageDraw, ImageFont

BACKGROUND, LINE = "#14181D", "#2E3742"
"""Colours of the background and of lines."""
TEXT, SECONDARY_TEXT, INACTIVE = "#F3F6F8", "#9AA6B2", "#66727F"
"""Colours of primary text, of secondary text, and of inactive nodes."""
RUNNING, SUCCESS, FAILURE = "#F2A71B", "#45BD70", "#F0685C"
"""Colours of the statuses: the colours in `view/tree/tree.svg`, lightened for the dark background."""
STATUS_COLOURS = {"RUNNING": RUNNING, "SUCCESS": SUCCESS, "FAILURE": FAILURE}
"""Colour of a status mark by status; the mark of any other status has the colour `INACTIVE`."""

_OVERSAMPLING = 8
"""Factor by which a mark is drawn larger before it is scaled down for antialiasing."""
_LINE_WIDTH = 0.17
"""Width of the lines of a mark [fraction of the size of the mark]."""
_TRIANGLE_MARK = [(0.16, 0.08), (0.92, 0.5), (0.16, 0.92)]
"""Corners of the mark for RUNNING: points (x, y), y down [fraction of the size of the mark]."""
_MARK_LINES = {
    "SUCCESS": [[(0.12, 0.54), (0.4, 0.82), (0.9, 0.22)]],
    "FAILURE": [[(0.17, 0.17), (0.83, 0.83)], [(0.83, 0.17), (0.17, 0.83)]],
}
"""Lines of a mark by status: points (x, y), y down [fraction of the size of the mark]."""


@lru_cache(maxsize=32)
def load_font(size: float) -> ImageFont.FreeTypeFont:
    """Return the built-in font of Pillow in the size `size` [pixel]."""
    default_font = ImageFont.load_default(size)
    assert isinstance(default_font, ImageFont.FreeTypeFont), "Pillow's wheels draw with FreeType"
    return default_font


@lru_cache(maxsize=4096)
def truncate_text(text: str, font_size: float, max_width: float) -> str:
    """Return a text as one line of at most `max_width` [pixel], truncated with an ellipsis."""
    line, font = " ".join(text.split()), load_font(font_size)
    if font.getlength(line) <= max_width:
        return line
    while line and font.getlength(line + "…") > max_width:
        line = line[:-1]
    return line.rstrip() + "…" if line else ""


def wrap_text(text: str, font_size: float, max_width: float, max_lines: int) -> list[str]:
    """Return a text as at most `max_lines` lines of at most `max_width` [pixel]; truncate the last line."""
    lines: list[str] = []
    for word in text.split():
        line = f"{lines[-1]} {word}" if lines else word
        if lines and (len(lines) == max_lines or load_font(font_size).getlength(line) <= max_width):
            lines[-1] = line
        else:
            lines.append(word)
    return [truncate_text(line, font_size, max_width) for line in lines]


def draw_mark(image: Image.Image, status: str, centre: tuple[float, float], size: int) -> None:
    """Draw a status mark: triangle for RUNNING, check mark for SUCCESS, cross for FAILURE, dot for any other.

    `centre` is the position of the mark, `size` the width and height of the mark [pixel].
    """
    corner = round(centre[0] - size / 2), round(centre[1] - size / 2)
    image.paste(STATUS_COLOURS.get(status, INACTIVE), corner, _draw_mask(status, size))


@lru_cache(maxsize=16)
def _draw_mask(status: str, size: int) -> Image.Image:
    """Return the coverage of each pixel by the mark of a status, 0 to 255, `(size, size)`."""
    large_size = size * _OVERSAMPLING
    mask = Image.new("L", (large_size, large_size))
    draw = ImageDraw.Draw(mask)
    if status == "RUNNING":
        draw.polygon([(x * large_size, y * large_size) for x, y in _TRIANGLE_MARK], 255)
    elif status not in _MARK_LINES:
        draw.circle((large_size / 2, large_size / 2), 0.16 * large_size, 255)
    for line in _MARK_LINES.get(status, ()):
        points = [(x * large_size, y * large_size) for x, y in line]
        width = round(large_size * _LINE_WIDTH)
        draw.line(points, 255, width, joint="curve")
        for end in (points[0], points[-1]):
            draw.circle(end, width / 2, 255)
    return mask.resize((size, size), Image.Resampling.BOX)
