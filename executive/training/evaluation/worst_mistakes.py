"""Worst mistakes of a detector, and a contact sheet of the mistakes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell.frame import Box, Detection
from executive.training.dataset import LabelledImage
from executive.training.evaluation.error_statistics import BoxMatch

MAX_COLUMN_COUNT = 6
"""Maximum number of tiles in a row of the sheet."""
TILE_SIZE = 240
"""Side of a tile [pixel]."""
CAPTION_HEIGHT = 40
"""Height of a caption [pixel]."""
HEADER_HEIGHT = 34
"""Height of the header of the sheet [pixel]."""
GAP = 10
"""Distance between two tiles [pixel]."""
MAX_TEXT_LENGTH = 36
"""Maximum number of characters of a line of a caption."""
CROP_SCALE = 2.2
"""Side of the crop of the image, as a multiple of the longer side of the mistake's box."""
MIN_CROP_SIZE = 40.0
"""Minimum side of the crop [pixel of the image]."""
LINE_THICKNESS = 2
"""Thickness of the lines [pixel]."""
LEGEND = "boxes: detected, corners: ground truth"
"""Text in the header that explains the lines."""
BACKGROUND_COLOUR = (32, 38, 43)
"""Colour of the background, RGB."""
TEXT_COLOUR = (255, 255, 255)
"""Colour of texts, RGB."""
TRUE_COLOUR = "#56B4E9"
"""Colour of true boxes."""
DETECTED_COLOUR = "#E69F00"
"""Colour of detected boxes."""

Picture = NDArray[np.uint8]
"""An image `(H, W, 3)`, RGB."""


@dataclass(frozen=True, eq=False)
class Mistake:
    """Detection error: missed object, false detection, wrong class, or offset of a correct detection.

    Attributes:
        severity: Visible fraction of a missed object (halved if truncated), confidence of a wrong detection,
            or offset of a correct box divided by the longer side of the true box; 0 to 1.
        text: Short description of the mistake.
        box: Box around the mistake [pixel].
        sample: The labelled image.
        detections: All detections in the image at or above the threshold.
    """

    severity: float
    text: str
    box: Box
    sample: LabelledImage
    detections: tuple[Detection, ...]


def collect_mistakes(
    mistakes: list[Mistake], matches: Sequence[BoxMatch], sample: LabelledImage, max_count: int = 24
) -> None:
    """Add the mistakes in one image to `mistakes`, and keep the most severe `max_count`, sorted."""
    mistakes += find_mistakes(matches, sample)
    mistakes.sort(key=lambda mistake: -mistake.severity)
    del mistakes[max_count:]


def find_mistakes(matches: Sequence[BoxMatch], sample: LabelledImage) -> Iterator[Mistake]:
    """Yield the mistakes in one image, including the position errors of correct detections."""
    detections = tuple(match.detection for match in matches)
    detected_objects = {match.object_index for match in matches}
    for index, label in enumerate(sample.labels):
        if index not in detected_objects:
            fraction = sample.get_visible_fraction(index)
            truncation = "" if sample.is_fully_inside(index) else ", truncated"
            visibility = "" if fraction >= 0.995 else f", {fraction:.0%} visible"
            text = f"{label} missed{visibility}{truncation}"
            yield Mistake(fraction / (2 if truncation else 1), text, sample.boxes[index], sample, detections)
    for match in matches:
        box, severity = match.detection.box, match.detection.confidence
        text = f"{match.detection.label} {severity:.2f}"
        if match.is_correct:
            offset = float(np.hypot(*match.offset))
            size = max(match.box[2] - match.box[0], match.box[3] - match.box[1], 1.0)
            severity, text = min(offset / size, 1.0), f"{match.detection.label} off by {offset:.1f} px"
        elif match.object_index is None:
            text = f"false detection: {text}"
        else:
            text = f"{sample.labels[match.object_index]} detected as {text}"
        left, top, right, bottom = match.box
        enclosing_box = min(box[0], left), min(box[1], top), max(box[2], right), max(box[3], bottom)
        yield Mistake(severity, text, enclosing_box, sample, detections)


def draw_sheet(mistakes: Sequence[Mistake], title: str) -> Picture:
    """Return a picture with one tile per mistake; title and legend are in the header."""
    column_count = min(MAX_COLUMN_COUNT, max(len(mistakes), 3))
    row_count = max(math.ceil(len(mistakes) / column_count), 1)
    column_width = TILE_SIZE + GAP
    row_height = TILE_SIZE + CAPTION_HEIGHT + GAP
    size = (HEADER_HEIGHT + row_count * row_height, GAP + column_count * column_width, 3)
    sheet = np.full(size, BACKGROUND_COLOUR, np.uint8)
    _write_text(sheet, f"{title}: {LEGEND if mistakes else 'no mistakes'}", GAP, HEADER_HEIGHT - GAP)
    for index, mistake in enumerate(mistakes):
        row, column = divmod(index, column_count)
        left = GAP + column * column_width
        top = HEADER_HEIGHT + row * row_height
        bottom = top + TILE_SIZE
        sheet[top:bottom, left : left + TILE_SIZE] = _draw_tile(mistake)
        _write_text(sheet, f"{index + 1}. {mistake.text}"[:MAX_TEXT_LENGTH], left, bottom + 15)
        _write_text(sheet, mistake.sample.file[:MAX_TEXT_LENGTH], left, bottom + 32)
    return sheet


def _draw_tile(mistake: Mistake) -> Picture:
    """Return a crop around a mistake with true and detected boxes, `(TILE_SIZE, TILE_SIZE, 3)` RGB."""
    import supervision as sv

    left, top, right, bottom = mistake.box
    crop_size = max(CROP_SCALE * max(right - left, bottom - top), MIN_CROP_SIZE)
    crop_corner = np.array([left + right - crop_size, top + bottom - crop_size]) / 2
    zoom = TILE_SIZE / crop_size
    # The centre of pixel i is at i + 0.5 in the coordinates of boxes, and at i in the coordinates of OpenCV.
    shift = zoom * (0.5 - crop_corner) - 0.5
    matrix = np.array([[zoom, 0.0, shift[0]], [0.0, zoom, shift[1]]])
    image = mistake.sample.image[..., ::-1]  # The annotators expect BGR.
    tile: Any = cv2.warpAffine(image, matrix, (TILE_SIZE, TILE_SIZE), flags=cv2.INTER_CUBIC)
    detected_boxes = [detection.box for detection in mistake.detections]
    for annotator, boxes, colour in (
        (sv.BoxAnnotator, detected_boxes, DETECTED_COLOUR),
        (sv.BoxCornerAnnotator, mistake.sample.boxes, TRUE_COLOUR),
    ):
        tile_boxes = ((np.array(boxes).reshape(-1, 2, 2) - crop_corner) * zoom).reshape(-1, 4)
        detections = sv.Detections(tile_boxes, class_id=np.zeros(len(boxes), int))
        tile = annotator(sv.Color.from_hex(colour), LINE_THICKNESS).annotate(tile, detections)
    return np.asarray(tile[..., ::-1], dtype=np.uint8)


def _write_text(picture: Picture, text: str, left: int, baseline: int) -> None:
    cv2.putText(picture, text, (left, baseline), cv2.FONT_HERSHEY_SIMPLEX, 0.42, TEXT_COLOUR, 1, cv2.LINE_AA)
