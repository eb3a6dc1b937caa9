"""Drawing of a picture: an image with boxes and shaded occlusions, above a status bar with a close-up."""

from __future__ import annotations

from typing import cast

import numpy as np
from numpy.typing import NDArray

from executive.cell.frame import Box
from executive.record.pictures.palette import BACKGROUND, OUTLINE, choose_class_colour, to_bgr
from executive.record.pictures.picture_content import PictureContent
from executive.record.pictures.status_bar import STATUS_BAR_HEIGHT, draw_status_bar

PICTURE_WIDTH = 640
"""Width of a picture [pixel]; camera images are scaled to this width, at which text is legible."""

SHADING_FRACTION = 0.4
"""Fraction of the background colour in occluded pixels, 0 to 1."""

CLOSE_UP_SCALE = 2.0
"""Side of the square region in the close-up, as a multiple of the longer side of the selected box."""

BOX_WIDTH, SELECTED_BOX_WIDTH, OUTLINE_WIDTH = 2, 3, 1
"""Line widths of a box, of the selected box, and of the outline on both sides of this line [pixel]."""

TEXT_SCALE, TEXT_PADDING = 0.36, 2
"""Font scale of captions in OpenCV, and padding around captions [pixel]."""


def draw_picture(scene: PictureContent) -> NDArray[np.uint8]:
    """Return the picture of a scene `(H, PICTURE_WIDTH, 3)`, RGB."""
    import cv2

    image = scene.image[:, :, ::-1]
    height, width = image.shape[:2]
    scale = PICTURE_WIDTH / width
    size = (PICTURE_WIDTH, round(height * scale))
    shaded = _shade(image, scene.visible)
    upper = _draw_boxes(cv2.resize(shaded, size).astype(np.uint8), scene, scale)
    if scene.selected is None:
        bar = draw_status_bar(scene, PICTURE_WIDTH)
    else:
        bar = draw_status_bar(scene, PICTURE_WIDTH, left=STATUS_BAR_HEIGHT)
        selected = scene.detections[scene.selected]
        colour = choose_class_colour(selected.label, scene.classes)
        bar[:, :STATUS_BAR_HEIGHT] = _draw_close_up(image, selected.box, colour)
    return np.vstack([upper, bar])[:, :, ::-1]


def _shade(image: NDArray[np.uint8], visible: NDArray[np.bool_] | None) -> NDArray[np.uint8]:
    """Return the image `(H, W, 3)` with shaded occluded pixels; `visible` is a mask `(H, W)`."""
    if visible is None or visible.all():
        return image
    shaded = image.copy()
    background = np.array(to_bgr(BACKGROUND))
    shaded[~visible] = (1 - SHADING_FRACTION) * image[~visible] + SHADING_FRACTION * background
    return shaded


def _draw_close_up(image: NDArray[np.uint8], box: Box, colour: str) -> NDArray[np.uint8]:
    """Return the enlarged square region around a box, `(STATUS_BAR_HEIGHT, STATUS_BAR_HEIGHT, 3)` BGR."""
    import cv2

    left, top, right, bottom = box
    side = max(2.0, CLOSE_UP_SCALE * max(right - left, bottom - top))
    zoom = STATUS_BAR_HEIGHT / side
    corner = np.array([(left + right) / 2, (top + bottom) / 2]) - side / 2
    # The matrix maps the upper left corner of the square to the origin.
    matrix = np.array([[zoom, 0.0, -zoom * corner[0]], [0.0, zoom, -zoom * corner[1]]])
    size, border = (STATUS_BAR_HEIGHT, STATUS_BAR_HEIGHT), to_bgr(BACKGROUND)
    close_up = cv2.warpAffine(image, matrix, size, flags=cv2.INTER_CUBIC, borderValue=border)
    cv2.rectangle(close_up, (1, 1), (STATUS_BAR_HEIGHT - 2, STATUS_BAR_HEIGHT - 2), to_bgr(colour), 3)
    return close_up.astype(np.uint8)


def _draw_boxes(image: NDArray[np.uint8], scene: PictureContent, scale: float) -> NDArray[np.uint8]:
    """Return an image, which was scaled by `scale`, with all boxes; the selected box is drawn last."""
    import supervision as sv

    if not scene.detections:
        return image
    indices = np.arange(len(scene.detections))
    colours = sv.ColorPalette.from_hex(
        [choose_class_colour(found.label, scene.classes) for found in scene.detections]
    )
    detections = sv.Detections(np.array([found.box for found in scene.detections]) * scale, class_id=indices)
    others, selected = (
        cast("sv.Detections", detections[mask])
        for mask in (indices != scene.selected, indices == scene.selected)
    )
    outline = sv.Color.from_hex(OUTLINE)
    for shown, colour, thickness in (
        (others, colours, BOX_WIDTH), (selected, outline, SELECTED_BOX_WIDTH + 2 * OUTLINE_WIDTH),
        (selected, colours, SELECTED_BOX_WIDTH),
    ):  # fmt: skip
        image = sv.BoxAnnotator(colour, thickness).annotate(image, shown)
    return sv.LabelAnnotator(
        colours,
        text_color=sv.Color.BLACK,
        text_scale=TEXT_SCALE,
        text_padding=TEXT_PADDING,
        smart_position=True,
    ).annotate(image, detections, make_captions(scene))


def make_captions(scene: PictureContent) -> list[str]:
    """Return the caption of each box: name of the item or class, and confidence of the detection."""
    return [
        f"{scene.item if index == scene.selected and scene.item else found.label} {found.confidence:.2f}"
        for index, found in enumerate(scene.detections)
    ]
