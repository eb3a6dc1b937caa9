"""Colours and type of a film, and text that stays within its width."""

from __future__ import annotations

from functools import lru_cache

from PIL import ImageFont

BACK, CARD, RULE = "#14181D", "#222932", "#2E3742"
"""Colours behind everything, of what stands out from it, and of lines."""
INK, DIM, FAINT = "#F3F6F8", "#9AA6B2", "#66727F"
"""Colours of text: what is looked at, what is read, what is at rest."""
RUNNING, SUCCESS, FAILURE = "#F2A71B", "#45BD70", "#F0685C"
"""Colours of a status, those of `executive.view.tree.style` as they show on a dark ground."""
STATUS = {"RUNNING": RUNNING, "SUCCESS": SUCCESS, "FAILURE": FAILURE}
"""Colour by status; a node of another one rests."""

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
