"""Boxes and labels on an image, drawn by supervision. Images are BGR here, as OpenCV has them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from executive.messages import Box
from executive.record.pictures.labels import PLACES, label_places
from executive.record.pictures.palette import RIM, class_colour
from executive.record.pictures.scene import Scene

THIN, THICK, RIM_WIDTH = 2, 3, 1
"""Lines of a box, of the chosen one, and of the rim on both sides of that [pixel]."""

TEXT_SCALE, PADDING = 0.36, 2
"""Size of labels in OpenCV's unit, and the free space around their text [pixel]."""


def draw_boxes(image: NDArray[np.uint8], scene: Scene, scale: float) -> NDArray[np.uint8]:
    """Return the image, `scale` times as large as the scene's, with every box on it, the chosen one last."""
    import supervision as sv

    if not scene.seen:
        return image
    chosen = [] if scene.chosen is None else [scene.chosen]
    rest = [number for number in range(len(scene.seen)) if number not in chosen]
    boxes = np.array([seen.box for seen in scene.seen], dtype=float) * scale
    colours: Any = sv.ColorPalette.from_hex([class_colour(seen.label, scene.classes) for seen in scene.seen])
    every: Any = sv.Detections(xyxy=boxes, class_id=np.arange(len(boxes)))
    texts = captions(scene)
    rim = sv.Color.from_hex(RIM)
    for numbers, colour, thickness in (
        (rest, colours, THIN), (chosen, rim, THICK + 2 * RIM_WIDTH), (chosen, colours, THICK),
    ):  # fmt: skip
        image = sv.BoxAnnotator(color=colour, thickness=thickness).annotate(image, every[numbers])
    places = _places(image, boxes.tolist(), texts, first=chosen + rest)
    for place in PLACES:
        there = [number for number in rest + chosen if places[number] == place]
        image = sv.LabelAnnotator(
            color=colours, text_color=sv.Color.BLACK, text_scale=TEXT_SCALE, text_padding=PADDING,
            text_position=sv.Position[place],
        ).annotate(image, every[there], [texts[number] for number in there])  # fmt: skip
    return image


def captions(scene: Scene) -> list[str]:
    """Return the text of each box: what it is believed to be, and the detector's confidence."""
    return [
        f"{scene.item if number == scene.chosen and scene.item else seen.label} {seen.confidence:.2f}"
        for number, seen in enumerate(scene.seen)
    ]


def _places(
    image: NDArray[np.uint8], boxes: Sequence[Box], texts: Sequence[str], first: Sequence[int]
) -> dict[int, str]:
    """Return where the label of each box goes, by its number; those `first` in line choose first."""
    import cv2

    sizes = [cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, TEXT_SCALE, 1)[0] for text in texts]
    padded = [(width + 2 * PADDING, height + 2 * PADDING) for width, height in sizes]
    height, width = image.shape[:2]
    places = label_places([boxes[n] for n in first], [padded[n] for n in first], width, height)
    return dict(zip(first, places, strict=True))
