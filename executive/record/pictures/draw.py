"""A picture: the image with its boxes, the hidden parts shaded, and the strip with a close-up below."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from executive.cell.frame import Box
from executive.record.pictures.boxes import draw_boxes
from executive.record.pictures.palette import GROUND, bgr, class_colour
from executive.record.pictures.scene import PictureScene
from executive.record.pictures.strip import HEIGHT, draw_strip

WIDTH = 640
"""Width of every picture [pixel], whatever the camera's is, so that its text can be read."""

SHADE = 0.4
"""How far hidden parts go towards the colour of the strip: 0 not at all, 1 entirely."""

SURROUNDINGS = 2.0
"""Side of what the close-up shows, in sides of the chosen box."""


def draw(scene: PictureScene) -> NDArray[np.uint8]:
    """Return the picture of a scene, `(rows, WIDTH, 3)` RGB; the scene's own image is left alone."""
    import cv2

    image = scene.image[:, :, ::-1]
    height, width = image.shape[:2]
    scale = WIDTH / width
    size = (WIDTH, round(height * scale))
    shaded = _shaded(image, scene.visible)
    top = draw_boxes(cv2.resize(shaded, size).astype(np.uint8), scene, scale)
    if scene.chosen is None:
        below = draw_strip(scene, WIDTH)
    else:
        below = draw_strip(scene, WIDTH, left=HEIGHT)
        chosen = scene.seen[scene.chosen]
        below[:, :HEIGHT] = _close_up(image, chosen.box, class_colour(chosen.label, scene.classes))
    return np.vstack([top, below])[:, :, ::-1]


def _shaded(image: NDArray[np.uint8], visible: NDArray[np.bool_] | None) -> NDArray[np.uint8]:
    """Return the image with what is hidden darkened."""
    if visible is None or visible.all():
        return image
    ground = np.array(bgr(GROUND))
    shaded = image.copy()
    shaded[~visible] = (1 - SHADE) * image[~visible] + SHADE * ground
    return shaded


def _close_up(image: NDArray[np.uint8], box: Box, colour: str) -> NDArray[np.uint8]:
    """Return the chosen object and what is around it, `(HEIGHT, HEIGHT, 3)` BGR."""
    import cv2

    left, top, right, bottom = box
    side = max(2.0, SURROUNDINGS * max(right - left, bottom - top))
    zoom = HEIGHT / side
    corner = np.array([(left + right) / 2, (top + bottom) / 2]) - side / 2
    # Maps the square's corner to the origin; what lies outside of the image gets the strip's colour.
    matrix = np.array([[zoom, 0.0, -zoom * corner[0]], [0.0, zoom, -zoom * corner[1]]])
    close = cv2.warpAffine(image, matrix, (HEIGHT, HEIGHT), flags=cv2.INTER_CUBIC, borderValue=bgr(GROUND))
    cv2.rectangle(close, (1, 1), (HEIGHT - 2, HEIGHT - 2), bgr(colour), 3)
    return close.astype(np.uint8)
