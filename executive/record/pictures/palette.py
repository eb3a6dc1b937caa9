"""The colours of pictures, as hexadecimal RGB."""

from __future__ import annotations

from collections.abc import Sequence

PALETTE = ("#56B4E9", "#E69F00", "#009E73", "#CC79A7", "#F0E442", "#0072B2", "#D55E00")
"""Colours of classes, which colour-blind people can distinguish too; black text can be read on each.

Okabe and Ito, "Color Universal Design", 2008, without their black.
"""

GROUND, INK, FAINT, WARNING = "#20262B", "#FFFFFF", "#A9B4BC", "#FF8A65"
"""Colours of the strip: behind the text, of text, of text that matters less, of failures."""

RIM = "#000000"
"""Colour around boxes, which sets them off from any image."""


def class_colour(label: str, classes: Sequence[str]) -> str:
    """Return the colour of a class; beyond the palette's length colours come again."""
    return PALETTE[classes.index(label) % len(PALETTE)] if label in classes else INK


def bgr(colour: str) -> tuple[int, int, int]:
    """Return a colour in OpenCV's order of channels."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return blue, green, red
