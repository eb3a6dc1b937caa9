"""Where the label of each box goes, so that it hides neither another box nor another label."""

from __future__ import annotations

from collections.abc import Sequence

from executive.messages import Box

PLACES = ("TOP_LEFT", "BOTTOM_LEFT", "CENTER_RIGHT", "CENTER_LEFT", "TOP_RIGHT", "BOTTOM_RIGHT")
"""Where a label may stand at its box, the first choice first; supervision's names."""


def label_places(
    boxes: Sequence[Box], sizes: Sequence[tuple[float, float]], width: float, height: float
) -> list[str]:
    """Return one of `PLACES` per box: where its label hides least.

    Args:
        boxes: Boxes in an image [pixel]; those that come first choose first.
        sizes: Width and height of each box's label [pixel].
        width: The image's [pixel].
        height: The image's [pixel].
    """
    taken = list(boxes)
    image = (0.0, 0.0, width, height)
    places = []
    for box, size in zip(boxes, sizes, strict=True):
        areas = {place: _area(box, size, place) for place in PLACES}
        # What lies outside of the image hides nothing, but cannot be read.
        hidden = {
            place: sum(_overlap(area, other) for other in taken) + size[0] * size[1] - _overlap(area, image)
            for place, area in areas.items()
        }
        # Rounded: what a float's last digit hides is no reason to go elsewhere.
        best = min(PLACES, key=lambda place: round(hidden[place]))
        places.append(best)
        taken.append(areas[best])
    return places


def _area(box: Box, size: tuple[float, float], place: str) -> Box:
    """Return what a label covers at one of the places of its box."""
    left, top, right, bottom = box
    width, height = size
    row, column = place.split("_")
    if row == "CENTER":
        x = right if column == "RIGHT" else left - width
        y = (top + bottom - height) / 2
    else:
        x = left if column == "LEFT" else right - width
        y = top - height if row == "TOP" else bottom
    return x, y, x + width, y + height


def _overlap(first: Box, second: Box) -> float:
    """Return how much of two boxes is in both [pixel²]."""
    width = min(first[2], second[2]) - max(first[0], second[0])
    height = min(first[3], second[3]) - max(first[1], second[1])
    return max(0.0, width) * max(0.0, height)
