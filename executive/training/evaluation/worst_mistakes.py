"""Worst mistakes of a detector, and a contact sheet of the mistakes."""

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
from executive.training.dataset import LabelledImage
from executive.training.evaluation.matching import BoxMatch

MAX_COLUMN_COUNT = 6
"""Maximum number of tiles in a row of the sheet."""
TILE_SIZE, CAPTION_HEIGHT, GAP, HEADER_HEIGHT = 240, 40, 10, 34
"""Side of a tile, height of a caption, gap between tiles, height of the header of the sheet [pixel]."""
CROP_SCALE = 2.2
"""Side of the crop of the image, as a multiple of the longer side of the mistake's box."""
MIN_CROP_SIZE = 40.0
"""Minimum side of the crop [pixel of the image]."""
LINE_THICKNESS = 2
"""Thickness of the coloured lines [pixel]."""
LEGEND = "boxes: detected, corners: ground truth"
"""Text in the header that explains the lines."""

BACKGROUND_COLOUR, TEXT_COLOUR, CAPTION_COLOUR = (32, 38, 43), (255, 255, 255), (169, 180, 188)
"""Colours of the background, of titles, and of file names and legend, RGB."""
TRUE_COLOUR, DETECTED_COLOUR, OUTLINE_COLOUR = "#56B4E9", "#E69F00", "#000000"
"""Colours of true boxes, of detected boxes, and of the outline around their lines."""

HEADER_BASELINE, TEXT_BASELINE, FILE_BASELINE = 21, 15, 32
"""Baselines of the header text and of both caption lines, from the top of header and caption [pixel]."""
FONT, FONT_SCALE = cv2.FONT_HERSHEY_SIMPLEX, 0.42
"""Font of OpenCV, and scale factor of the base size of the font."""

Picture = NDArray[np.uint8]
"""An image `(H, W, 3)`, RGB."""
Colour = tuple[int, int, int]
"""Red, green and blue, 0 to 255."""


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


class WorstMistakes:
    """Worst mistakes in all images.

    Args:
        max_count: Maximum number of mistakes.

    Attributes:
        mistakes: Mistakes from the most to the least severe.
    """

    def __init__(self, max_count: int = 24) -> None:
        self._max_count = max_count
        self.mistakes: list[Mistake] = []

    def add(self, matches: Sequence[BoxMatch], sample: LabelledImage) -> None:
        """Add the mistakes in one image, and remove the least severe mistakes beyond the maximum number."""
        self.mistakes += find_mistakes(matches, sample)
        self.mistakes.sort(key=lambda mistake: -mistake.severity)
        del self.mistakes[self._max_count :]


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
    """Return a contact sheet `(H, W, 3)`, RGB, with a tile for each mistake and `title` in the header."""
    columns = min(MAX_COLUMN_COUNT, max(len(mistakes), 3))
    rows = max(math.ceil(len(mistakes) / columns), 1)
    column_width, row_height = TILE_SIZE + GAP, TILE_SIZE + CAPTION_HEIGHT + GAP
    width = GAP + columns * column_width
    sheet = np.full((HEADER_HEIGHT + rows * row_height, width, 3), BACKGROUND_COLOUR, np.uint8)
    legend_left = width - GAP - _measure_text(LEGEND)
    _write_text(sheet, LEGEND, (legend_left, HEADER_BASELINE), CAPTION_COLOUR)
    header = title if mistakes else f"{title}: no mistakes"
    _write_text(sheet, header, (GAP, HEADER_BASELINE), TEXT_COLOUR, legend_left - 2 * GAP)
    for index, mistake in enumerate(mistakes):
        row, column = divmod(index, columns)
        left, top = GAP + column * column_width, HEADER_HEIGHT + row * row_height
        sheet[top : top + TILE_SIZE, left : left + TILE_SIZE] = _draw_tile(mistake)
        bottom = top + TILE_SIZE
        _write_text(sheet, f"{index + 1}. {mistake.text}", (left, bottom + TEXT_BASELINE), TEXT_COLOUR)
        _write_text(sheet, mistake.sample.file, (left, bottom + FILE_BASELINE), CAPTION_COLOUR)
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
    size, border = (TILE_SIZE, TILE_SIZE), BACKGROUND_COLOUR[::-1]
    tile = cv2.warpAffine(image, matrix, size, flags=cv2.INTER_CUBIC, borderValue=border)
    detected = sv.BoxAnnotator, [detection.box for detection in mistake.detections], DETECTED_COLOUR
    layers: Any = (detected, (sv.BoxCornerAnnotator, mistake.sample.boxes, TRUE_COLOUR))
    for annotator, boxes, colour in layers:
        tile_boxes = ((np.array(boxes).reshape(-1, 2, 2) - crop_corner) * zoom).reshape(-1, 4)
        detections = sv.Detections(tile_boxes, class_id=np.zeros(len(boxes), int))
        for hex_colour, thickness in ((OUTLINE_COLOUR, 2 * LINE_THICKNESS), (colour, LINE_THICKNESS)):
            tile = annotator(sv.Color.from_hex(hex_colour), thickness).annotate(tile, detections)
    return np.asarray(tile[..., ::-1], dtype=np.uint8)


def _write_text(
    image: Picture, text: str, corner: tuple[int, int], colour: Colour, max_width: int = TILE_SIZE
) -> None:
    """Write a text with its lower left corner at `corner` [pixel], truncated to `max_width` [pixel]."""
    written_text = text
    while _measure_text(written_text) > max_width and len(text) > 1:
        text = text[:-1]
        written_text = f"{text}..."
    cv2.putText(image, written_text, corner, FONT, FONT_SCALE, colour, 1, cv2.LINE_AA)


def _measure_text(text: str) -> int:
    """Return the width of a text [pixel]."""
    return int(cv2.getTextSize(text, FONT, FONT_SCALE, 1)[0][0])
