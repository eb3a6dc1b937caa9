"""Draw what a decision was made from: the image, every box found, and the chosen one.

Run as a program (`python -m executive.record.overlay`), it takes pictures to draw from its standard
input, pickled one after another, until that ends.
"""

from __future__ import annotations

import os
import pickle
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from executive.errors import ExecutiveError

CHOSEN, OTHER = "#00C853", "#B0BEC5"
"""Colours of the chosen box and of the rest."""


@dataclass(frozen=True)
class Picture:
    """What to draw and where to put it.

    Attributes:
        path: File to write; its ending says the format.
        image: `(H, W, 3)` uint8, RGB.
        boxes: Left, top, right, bottom [pixel] of every detection.
        captions: One text per box.
        chosen: Number of the chosen box, or None.
    """

    path: Path
    image: NDArray[np.uint8]
    boxes: Sequence[Sequence[float]]
    captions: Sequence[str]
    chosen: int | None


def draw(picture: Picture) -> NDArray[np.uint8]:
    """Return a copy of the image with the boxes and captions on it, the chosen one drawn last and thicker."""
    import supervision as sv

    image = picture.image.copy()
    rest = [number for number in range(len(picture.boxes)) if number != picture.chosen]
    chosen = [] if picture.chosen is None else [picture.chosen]
    for numbers, colour, thickness in ((rest, OTHER, 1), (chosen, CHOSEN, 3)):
        if not numbers:
            continue
        detections = sv.Detections(
            xyxy=np.array([picture.boxes[number] for number in numbers], dtype=float),
            class_id=np.zeros(len(numbers), dtype=int),
        )
        captions = [picture.captions[number] for number in numbers]
        # The annotators expect OpenCV's order of channels; the image is RGB.
        red, green, blue = sv.Color.from_hex(colour).as_rgb()
        swapped = sv.Color(r=blue, g=green, b=red)
        image = sv.BoxAnnotator(color=swapped, thickness=thickness).annotate(image, detections)
        image = sv.LabelAnnotator(
            color=swapped, text_color=sv.Color.BLACK, text_scale=0.35, text_padding=3
        ).annotate(image, detections, captions)
    return image


def save(picture: Picture) -> None:
    """Draw `picture` and write its file.

    Raises:
        ExecutiveError: The file cannot be written.
    """
    import cv2

    if not cv2.imwrite(str(picture.path), cv2.cvtColor(draw(picture), cv2.COLOR_RGB2BGR)):
        raise ExecutiveError(f'cannot write the picture "{picture.path}"')


def serve(stream: Any) -> None:
    """Draw every picture that arrives on `stream` until it ends."""
    while True:
        try:
            picture = pickle.load(stream)
        except EOFError:
            return
        save(picture)


if __name__ == "__main__":
    os.nice(5)  # The tick loop goes first.
    serve(sys.stdin.buffer)
