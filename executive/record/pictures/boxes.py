"""Boxes and labels on an image, drawn by supervision. Images are BGR here, as OpenCV has them."""

from __future__ import annotations

from typing import cast

import numpy as np
from numpy.typing import NDArray

from executive.record.pictures.palette import RIM, class_colour
from executive.record.pictures.scene import PictureScene

THIN, THICK, RIM_WIDTH = 2, 3, 1
"""Lines of a box, of the chosen one, and of the rim on both sides of that [pixel]."""

TEXT_SCALE, PADDING = 0.36, 2
"""Size of labels in OpenCV's unit, and the free space around their text [pixel]."""


def draw_boxes(image: NDArray[np.uint8], scene: PictureScene, scale: float) -> NDArray[np.uint8]:
    """Return the image, `scale` times as large as the scene's, with every box on it, the chosen one last."""
    import supervision as sv

    if not scene.seen:
        return image
    numbers = np.arange(len(scene.seen))
    colours = sv.ColorPalette.from_hex([class_colour(seen.label, scene.classes) for seen in scene.seen])
    every = sv.Detections(np.array([seen.box for seen in scene.seen]) * scale, class_id=numbers)
    rest, chosen = (
        cast("sv.Detections", every[mask]) for mask in (numbers != scene.chosen, numbers == scene.chosen)
    )
    rim = sv.Color.from_hex(RIM)
    for shown, colour, thickness in (
        (rest, colours, THIN), (chosen, rim, THICK + 2 * RIM_WIDTH), (chosen, colours, THICK),
    ):  # fmt: skip
        image = sv.BoxAnnotator(colour, thickness).annotate(image, shown)
    return sv.LabelAnnotator(
        colours, text_color=sv.Color.BLACK, text_scale=TEXT_SCALE, text_padding=PADDING, smart_position=True
    ).annotate(image, every, captions(scene))


def captions(scene: PictureScene) -> list[str]:
    """Return the text of each box: the item or class that it is taken for, and the detector's confidence."""
    return [
        f"{scene.item if number == scene.chosen and scene.item else seen.label} {seen.confidence:.2f}"
        for number, seen in enumerate(scene.seen)
    ]
