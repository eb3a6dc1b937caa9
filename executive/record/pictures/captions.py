"""Captions of the boxes in a picture, which do not overlap each other."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

FONT, TEXT_SCALE, PADDING = cv2.FONT_HERSHEY_SIMPLEX, 0.36, 2
"""Font of captions in OpenCV, its scale, and the padding around the text [pixel]."""
MIN_GAP = 2
"""Minimum distance between two captions [pixel]."""
BLACK = (0, 0, 0)

Rectangle = tuple[int, int, int, int]
"""Left, top, right and bottom side of a rectangle [pixel]."""
Colour = tuple[int, int, int]
"""Blue, green and red, 0 to 255."""


def draw_captions(
    image: NDArray[np.uint8],
    corners: Sequence[tuple[int, int]],
    captions: Sequence[str],
    colours: Sequence[Colour],
) -> None:
    """Draw each caption above the upper left corner of its box, in black on the colour of its class.

    `supervision` draws captions, too, but its import takes 0.8 to 2 s.

    Args:
        image: The picture `(H, W, 3)` BGR, which is changed.
        corners: Upper left corner of each box [pixel].
        captions: Text of each caption.
        colours: Background of each caption.
    """
    height, width = image.shape[:2]
    placed: list[Rectangle] = []
    for corner, caption, colour in zip(corners, captions, colours, strict=True):
        (text_width, text_height), _ = cv2.getTextSize(caption, FONT, TEXT_SCALE, 1)
        size = text_width + 2 * PADDING, text_height + 2 * PADDING
        left, top, right, bottom = place_caption(corner, size, (width, height), placed)
        placed.append((left, top, right, bottom))
        cv2.rectangle(image, (left, top), (right, bottom), colour, cv2.FILLED)
        origin = left + PADDING, top + PADDING + text_height
        cv2.putText(image, caption, origin, FONT, TEXT_SCALE, BLACK, 1, cv2.LINE_AA)


def place_caption(
    corner: tuple[int, int], size: tuple[int, int], image_size: tuple[int, int], others: Sequence[Rectangle]
) -> Rectangle:
    """Return the rectangle of a caption in the image, near `corner` and beside the other captions.

    Arguments are in pixels. If no place near the corner is free, the caption covers other captions.
    """
    (width, height), max_top = size, image_size[1] - size[1]
    left = max(0, min(corner[0], image_size[0] - width))
    preferred_top = max(0, min(corner[1] - height, max_top))
    obstacles = [each for each in others if each[0] < left + width + MIN_GAP and left < each[2] + MIN_GAP]
    tops = [preferred_top, *(bottom + MIN_GAP for _, _, _, bottom in obstacles)]
    tops += [top - MIN_GAP - height for _, top, _, _ in obstacles]
    free_tops = (
        top
        for top in sorted(tops, key=lambda top: abs(top - preferred_top))
        if 0 <= top <= max_top
        and all(top + height + MIN_GAP <= each[1] or each[3] + MIN_GAP <= top for each in obstacles)
    )
    top = next(free_tops, preferred_top)
    return left, top, left + width, top + height
