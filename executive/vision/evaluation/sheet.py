"""A picture of a detector's worst mistakes, the worst first."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.errors import InputError
from executive.messages import Box
from executive.vision.evaluation.misses import Miss

COLUMNS = 6
"""Mistakes side by side."""
TILE, CAPTION, GAP, HEAD = 240, 40, 10, 34
"""Side of a picture, height of the words below it, space around both, height of the head [pixel]."""
SURROUNDINGS = 2.2
"""Side of what a picture shows, in sides of the box it is about."""
LEAST_SHOWN = 40.0
"""Smallest side of what a picture shows [pixel of the image]: less shows no surroundings."""
DASH, THICK = 8, 2
"""Length of a dash and of the space after it, and thickness of the lines [pixel]."""

# BGR, as OpenCV has it.
GROUND, INK, FAINT = (43, 38, 32), (255, 255, 255), (188, 180, 169)
TRUE, FOUND, RIM = (233, 180, 86), (0, 159, 230), (0, 0, 0)
FONT = cv2.FONT_HERSHEY_SIMPLEX

Picture = NDArray[np.uint8]


def draw_sheet(misses: Sequence[Miss], title: str) -> Picture:
    """Return the picture, `(H, W, 3)` RGB.

    Args:
        misses: What it shows, in this order.
        title: What was measured, for the head.
    """
    columns = min(COLUMNS, max(len(misses), 3))
    rows = max(math.ceil(len(misses) / columns), 1)
    width, height = GAP + columns * (TILE + GAP), HEAD + rows * (TILE + CAPTION + GAP)
    sheet = np.full((height, width, 3), GROUND, np.uint8)
    _head(sheet, title if misses else f"{title}: no mistakes")
    for number, miss in enumerate(misses):
        row, column = divmod(number, columns)
        left, top = GAP + column * (TILE + GAP), HEAD + row * (TILE + CAPTION + GAP)
        sheet[top : top + TILE, left : left + TILE] = _picture(miss)
        _write(sheet, f"{number + 1}. {miss.text}", (left, top + TILE + 15), INK)
        _write(sheet, miss.sample.file, (left, top + TILE + 32), FAINT)
    return np.ascontiguousarray(sheet[..., ::-1])


def write_sheet(path: Path, misses: Sequence[Miss], title: str) -> None:
    """Write the picture to a file, whose ending says which kind it is.

    Raises:
        InputError: The file cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    if not cv2.imwrite(str(path), draw_sheet(misses, title)[..., ::-1]):
        raise InputError(
            f"the picture {path} could not be written; is the disk full or the folder read-only?"
        )


def _head(sheet: Picture, title: str) -> None:
    """Write what the sheet is about at the left, and what the lines mean at the right."""
    right = sheet.shape[1] - GAP
    for text, dashed in (("found", False), ("true", True)):
        right -= _extent(text)
        cv2.putText(sheet, text, (right, 21), FONT, 0.42, INK, 1, cv2.LINE_AA)
        right -= 34
        box = np.array([[right, 9], [right + 26, 24]])
        _outline(sheet, box, TRUE if dashed else FOUND, dashed=dashed)
        right -= 18
    _write(sheet, title, (GAP, 21), INK, right - GAP)


def _picture(miss: Miss) -> Picture:
    """Return the mistake and what is around it, `(TILE, TILE, 3)` BGR, with the true and the found boxes."""
    left, top, right, bottom = miss.box
    side = max(SURROUNDINGS * max(right - left, bottom - top), LEAST_SHOWN)
    corner = np.array([left + right - side, top + bottom - side]) / 2
    zoom = TILE / side
    # Pixel i covers [i, i + 1), OpenCV has its centre at i.
    shift = zoom * (0.5 - corner) - 0.5
    matrix = np.array([[zoom, 0.0, shift[0]], [0.0, zoom, shift[1]]])
    image = cv2.cvtColor(miss.sample.image, cv2.COLOR_RGB2BGR)
    tile = np.asarray(
        cv2.warpAffine(image, matrix, (TILE, TILE), flags=cv2.INTER_CUBIC, borderValue=GROUND), dtype=np.uint8
    )
    for detection in miss.found:
        _outline(tile, _zoomed(detection.box, corner, zoom), FOUND)
    for box in miss.sample.boxes:
        _outline(tile, _zoomed(box, corner, zoom), TRUE, dashed=True)
    return tile


def _zoomed(box: Box, corner: NDArray[np.float64], zoom: float) -> NDArray[np.int_]:
    """Return the corners `(2, 2)` of a box in the picture."""
    return np.asarray(((np.array(box).reshape(2, 2) - corner) * zoom).round().astype(int))


def _outline(
    picture: Picture, corners: NDArray[np.int_], colour: tuple[int, int, int], *, dashed: bool = False
) -> None:
    """Draw a box on a dark rim, which sets it off from any image."""
    (left, top), (right, bottom) = corners.tolist()
    across = [
        ((x, y), (min(x + DASH, right), y)) for y in (top, bottom) for x in range(left, right, 2 * DASH)
    ]
    down = [((x, y), (x, min(y + DASH, bottom))) for x in (left, right) for y in range(top, bottom, 2 * DASH)]
    for line, thick in ((RIM, 2 * THICK), (colour, THICK)):
        if not dashed:
            cv2.rectangle(picture, (left, top), (right, bottom), line, thick)
        for begin, end in (*across, *down) if dashed else ():
            cv2.line(picture, begin, end, line, thick)


def _write(
    picture: Picture, text: str, place: tuple[int, int], colour: tuple[int, int, int], room: int = TILE
) -> None:
    """Write a text, cut at its end where the room [pixel] ends."""
    shown = text
    while _extent(shown) > room and len(text) > 1:
        text = text[:-1]
        shown = f"{text}..."
    cv2.putText(picture, shown, place, FONT, 0.42, colour, 1, cv2.LINE_AA)


def _extent(text: str) -> int:
    return int(cv2.getTextSize(text, FONT, 0.42, 1)[0][0])
