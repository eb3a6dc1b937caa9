"""Worst mistakes of a detector, and a picture of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell.detection import Detection
from executive.cell.frame import Box
from executive.training.evaluation.matching import BoxMatch
from executive.training.labelled_image import LabelledImage

COLUMNS = 6
"""Largest number of mistakes in a row."""
TILE, CAPTION, GAP, HEAD = 240, 40, 10, 34
"""Side of a tile, height of its caption, gap between tiles, height of the header [pixel]."""
SURROUNDINGS = 2.2
"""Side of the crop as a multiple of the longer side of the mistake's box."""
MIN_SIDE = 40.0
"""Smallest side of the crop [pixel of the image]."""
THICKNESS = 2
"""Thickness of the lines [pixel]."""
LEGEND = "boxes: found, corners: true"

GROUND, INK, FAINT = (32, 38, 43), (255, 255, 255), (169, 180, 188)
"""Colours behind the text, of the text, and of text that matters less, RGB."""
TRUE, FOUND, RIM = "#56B4E9", "#E69F00", "#000000"
"""Colours of true boxes, of found ones, and of the rim that sets both off from any image."""

Picture = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Miss:
    """One mistake.

    Attributes:
        severity: Visible share of a missed object, confidence of a wrong detection, or offset of a box as
            a share of the object's size; 0 to 1.
        text: Short description of the mistake.
        box: Box around the mistake [pixel].
        sample: The image.
        found: All detections in the image above the threshold.
    """

    severity: float
    text: str
    box: Box
    sample: LabelledImage
    found: tuple[Detection, ...]


class WorstMisses:
    """Keeps the worst mistakes of all images, by falling severity; ties in the order of arrival.

    Args:
        count: Number of mistakes to keep.

    Attributes:
        kept: The mistakes.
    """

    def __init__(self, count: int = 24) -> None:
        self._count = count
        self.kept: list[Miss] = []

    def add(self, matches: Sequence[BoxMatch], sample: LabelledImage) -> None:
        """Look for mistakes in the answer to one image."""
        self.kept += misses(matches, sample)
        self.kept.sort(key=lambda miss: -miss.severity)
        del self.kept[self._count :]


def misses(matches: Sequence[BoxMatch], sample: LabelledImage) -> Iterator[Miss]:
    """Yield the mistakes in the answer to one image, and every right detection with the offset of its box."""
    found = tuple(one.detection for one in matches)
    taken = {one.number for one in matches}
    for number, label in enumerate(sample.labels):
        if number not in taken:
            share = sample.get_visible_fraction(number)
            cut = "" if sample.is_fully_inside(number) else ", cut off"
            showing = "" if share >= 0.995 else f", {share:.0%} visible"
            text = f"{label} overlooked{showing}{cut}"
            yield Miss(share / (2 if cut else 1), text, sample.boxes[number], sample, found)
    for one in matches:
        box, severity = one.detection.box, one.detection.confidence
        text = f"{one.detection.label} {severity:.2f}"
        if one.right:
            offset = float(np.hypot(*one.offset))
            size = max(one.box[2] - one.box[0], one.box[3] - one.box[1], 1.0)
            severity, text = min(offset / size, 1.0), f"{one.detection.label} off by {offset:.1f} px"
        elif one.number is None:
            text = f"no such thing: {text}"
        else:
            text = f"{sample.labels[one.number]} taken for {text}"
        left, top, right, bottom = one.box
        around = min(box[0], left), min(box[1], top), max(box[2], right), max(box[3], bottom)
        yield Miss(severity, text, around, sample, found)


def draw_sheet(misses: Sequence[Miss], title: str) -> Picture:
    """Return the picture, `(H, W, 3)` RGB.

    Args:
        misses: Mistakes, in the order shown.
        title: Name of the measurement, for the head.
    """
    columns = min(COLUMNS, max(len(misses), 3))
    rows = max(math.ceil(len(misses) / columns), 1)
    width, height = GAP + columns * (TILE + GAP), HEAD + rows * (TILE + CAPTION + GAP)
    sheet = np.full((height, width, 3), GROUND, np.uint8)
    legend = width - GAP - _width(LEGEND)
    _write(sheet, LEGEND, (legend, 21), FAINT)
    _write(sheet, title if misses else f"{title}: no mistakes", (GAP, 21), INK, legend - 2 * GAP)
    for number, miss in enumerate(misses):
        row, column = divmod(number, columns)
        left, top = GAP + column * (TILE + GAP), HEAD + row * (TILE + CAPTION + GAP)
        sheet[top : top + TILE, left : left + TILE] = _picture(miss)
        _write(sheet, f"{number + 1}. {miss.text}", (left, top + TILE + 15), INK)
        _write(sheet, miss.sample.file, (left, top + TILE + 32), FAINT)
    return sheet


def _picture(miss: Miss) -> Picture:
    """Return the mistake and its surroundings, `(TILE, TILE, 3)` RGB, with the true and the found boxes."""
    import supervision as sv

    left, top, right, bottom = miss.box
    side = max(SURROUNDINGS * max(right - left, bottom - top), MIN_SIDE)
    corner = np.array([left + right - side, top + bottom - side]) / 2
    zoom = TILE / side
    # In boxes, the centre of pixel i is at i + 0.5; in OpenCV, at i.
    shift = zoom * (0.5 - corner) - 0.5
    matrix = np.array([[zoom, 0.0, shift[0]], [0.0, zoom, shift[1]]])
    image = miss.sample.image[..., ::-1]  # The annotators draw on BGR.
    tile = cv2.warpAffine(image, matrix, (TILE, TILE), flags=cv2.INTER_CUBIC, borderValue=GROUND[::-1])
    found = [detection.box for detection in miss.found]
    kinds: Any = ((sv.BoxAnnotator, found, FOUND), (sv.BoxCornerAnnotator, miss.sample.boxes, TRUE))
    for annotator, boxes, colour in kinds:
        zoomed = ((np.array(boxes).reshape(-1, 2, 2) - corner) * zoom).reshape(-1, 4)
        shown = sv.Detections(zoomed, class_id=np.zeros(len(boxes), int))
        for line, thickness in ((RIM, 2 * THICKNESS), (colour, THICKNESS)):
            tile = annotator(sv.Color.from_hex(line), thickness).annotate(tile, shown)
    return np.asarray(tile[..., ::-1], dtype=np.uint8)


def _write(
    picture: Picture, text: str, place: tuple[int, int], colour: tuple[int, int, int], room: int = TILE
) -> None:
    """Write a text, cut at its end where the room [pixel] ends."""
    shown = text
    while _width(shown) > room and len(text) > 1:
        text = text[:-1]
        shown = f"{text}..."
    cv2.putText(picture, shown, place, cv2.FONT_HERSHEY_SIMPLEX, 0.42, colour, 1, cv2.LINE_AA)


def _width(text: str) -> int:
    return int(cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.42, 1)[0][0])
