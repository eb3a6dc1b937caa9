"""Colours of pictures, as hexadecimal RGB."""

from __future__ import annotations

from collections.abc import Sequence

PALETTE = ("#56B4E9", "#E69F00", "#009E73", "#CC79A7", "#F0E442", "#0072B2", "#D55E00")
"""Colours of classes, which colour-blind people can distinguish and on which black text is legible.

Okabe and Ito, "Color Universal Design", 2008, without black.
"""

GROUND, INK, FAINT, WARNING = "#20262B", "#FFFFFF", "#A9B4BC", "#FF8A65"
"""Colours of the strip: background, text, minor text and failures."""

RIM = "#000000"
"""Colour of the rim around the selected box, which contrasts with any image."""


def class_colour(label: str, classes: Sequence[str]) -> str:
    """Return the colour of a class by its index in `classes`; unknown classes have the colour of text."""
    return PALETTE[classes.index(label) % len(PALETTE)] if label in classes else INK


def bgr(colour: str) -> tuple[int, int, int]:
    """Return a colour as blue, green and red, 0 to 255."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return blue, green, red
