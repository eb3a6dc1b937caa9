"""Colours of pictures in hexadecimal RGB."""

from __future__ import annotations

from collections.abc import Sequence

PALETTE = ("#56B4E9", "#E69F00", "#009E73", "#CC79A7", "#F0E442", "#0072B2", "#D55E00")
"""Colours of classes; colour-blind people can distinguish these colours, and black text on them is legible.

Source: Okabe and Ito, "Color Universal Design", 2008, without black.
"""

BACKGROUND, TEXT, SECONDARY_TEXT, FAILURE_TEXT = "#20262B", "#FFFFFF", "#A9B4BC", "#FF8A65"
"""Colours of the status bar and of its normal text, secondary text, and text about a failure."""

OUTLINE = "#000000"
"""Colour of the outline of the selected box."""


def choose_class_colour(label: str, classes: Sequence[str]) -> str:
    """Return the colour of the class `label` from its index in `classes`; `TEXT` for an unknown class."""
    return PALETTE[classes.index(label) % len(PALETTE)] if label in classes else TEXT


def to_bgr(colour: str) -> tuple[int, int, int]:
    """Return the blue, green and red component of a hexadecimal colour, each 0 to 255."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return blue, green, red
