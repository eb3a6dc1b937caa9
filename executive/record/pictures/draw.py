"""Picture of a scene: the image with boxes and shaded hidden parts, above a strip with a close-up."""

from __future__ import annotations

from typing import cast

import numpy as np
from numpy.typing import NDArray

from executive.cell.frame import Box
from executive.record.pictures.palette import GROUND, RIM, bgr, class_colour
from executive.record.pictures.scene import PictureScene
from executive.record.pictures.strip import HEIGHT, draw_strip

WIDTH = 640
"""Width of a picture [pixel]; the image of a camera is scaled to this width, at which text is legible."""

SHADING = 0.4
"""Share of the background colour in hidden parts, 0 to 1."""

CLOSE_UP_SIZE = 2.0
"""Side of the square in the close-up, in longer sides of the selected box."""

BOX_LINE, SELECTED_LINE, RIM_LINE = 2, 3, 1
"""Line widths of a box, of the selected box and of the rim on both sides of the selected box [pixel]."""

TEXT_SCALE, TEXT_PADDING = 0.36, 2
"""Scale of the font of OpenCV for captions, and the padding around captions [pixel]."""


def draw(scene: PictureScene) -> NDArray[np.uint8]:
    """Return the picture of a scene, `(rows, WIDTH, 3)` RGB."""
    import cv2

    image = scene.image[:, :, ::-1]
    height, width = image.shape[:2]
    scale = WIDTH / width
    size = (WIDTH, round(height * scale))
    shaded = _shade(image, scene.visible)
    top = _draw_boxes(cv2.resize(shaded, size).astype(np.uint8), scene, scale)
    if scene.selected is None:
        below = draw_strip(scene, WIDTH)
    else:
        below = draw_strip(scene, WIDTH, left=HEIGHT)
        selected = scene.detections[scene.selected]
        below[:, :HEIGHT] = _draw_close_up(image, selected.box, class_colour(selected.label, scene.classes))
    return np.vstack([top, below])[:, :, ::-1]


def _shade(image: NDArray[np.uint8], visible: NDArray[np.bool_] | None) -> NDArray[np.uint8]:
    """Return the image with shaded hidden pixels."""
    if visible is None or visible.all():
        return image
    shaded = image.copy()
    shaded[~visible] = (1 - SHADING) * image[~visible] + SHADING * np.array(bgr(GROUND))
    return shaded


def _draw_close_up(image: NDArray[np.uint8], box: Box, colour: str) -> NDArray[np.uint8]:
    """Return an enlarged square around a box, `(HEIGHT, HEIGHT, 3)` BGR."""
    import cv2

    left, top, right, bottom = box
    side = max(2.0, CLOSE_UP_SIZE * max(right - left, bottom - top))
    zoom = HEIGHT / side
    corner = np.array([(left + right) / 2, (top + bottom) / 2]) - side / 2
    # The matrix maps the corner of the square to the origin. Pixels outside the image get the border colour.
    matrix = np.array([[zoom, 0.0, -zoom * corner[0]], [0.0, zoom, -zoom * corner[1]]])
    close = cv2.warpAffine(image, matrix, (HEIGHT, HEIGHT), flags=cv2.INTER_CUBIC, borderValue=bgr(GROUND))
    cv2.rectangle(close, (1, 1), (HEIGHT - 2, HEIGHT - 2), bgr(colour), 3)
    return close.astype(np.uint8)


def _draw_boxes(image: NDArray[np.uint8], scene: PictureScene, scale: float) -> NDArray[np.uint8]:
    """Return the image, which was scaled by `scale`, with all boxes; the selected box is drawn last."""
    import supervision as sv

    if not scene.detections:
        return image
    numbers = np.arange(len(scene.detections))
    colours = sv.ColorPalette.from_hex(
        [class_colour(found.label, scene.classes) for found in scene.detections]
    )
    detections = sv.Detections(np.array([found.box for found in scene.detections]) * scale, class_id=numbers)
    others, selected = (
        cast("sv.Detections", detections[mask])
        for mask in (numbers != scene.selected, numbers == scene.selected)
    )
    rim = sv.Color.from_hex(RIM)
    for shown, colour, thickness in (
        (others, colours, BOX_LINE), (selected, rim, SELECTED_LINE + 2 * RIM_LINE),
        (selected, colours, SELECTED_LINE),
    ):  # fmt: skip
        image = sv.BoxAnnotator(colour, thickness).annotate(image, shown)
    return sv.LabelAnnotator(
        colours,
        text_color=sv.Color.BLACK,
        text_scale=TEXT_SCALE,
        text_padding=TEXT_PADDING,
        smart_position=True,
    ).annotate(image, detections, captions(scene))


def captions(scene: PictureScene) -> list[str]:
    """Return the caption of each box: item or class, and the confidence of the detection."""
    return [
        f"{scene.item if number == scene.selected and scene.item else found.label} {found.confidence:.2f}"
        for number, found in enumerate(scene.detections)
    ]
