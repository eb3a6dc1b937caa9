"""Drawing of a picture: an image with boxes and shaded occlusions, above a status bar with a close-up."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.record.pictures.palette import BACKGROUND, OUTLINE, choose_class_colour, to_bgr
from executive.record.pictures.picture_content import PictureContent
from executive.record.pictures.status_bar import STATUS_BAR_HEIGHT, draw_status_bar

PICTURE_WIDTH = 640
"""Width of a picture and of the camera image in it [pixel]; captions of boxes are legible at this width."""

SHADING_FRACTION = 0.4
"""Fraction of the background colour in occluded pixels, 0 to 1."""

CLOSE_UP_SCALE = 2.0
"""Side of the square region in the close-up, as a multiple of the longer side of the selected box."""

LINE_WIDTH, SELECTED_LINE_WIDTH, OUTLINE_WIDTH = 2, 3, 1
"""Line widths of a box, of the selected box, and of the outline around the selected box [pixel]."""

FONT, TEXT_SCALE, PADDING = cv2.FONT_HERSHEY_SIMPLEX, 0.36, 2
"""Font of captions in OpenCV, its scale, and the padding around the text [pixel]."""
MIN_GAP = 2
"""Minimum distance between two captions [pixel]."""
BLACK = (0, 0, 0)

Rectangle = tuple[int, int, int, int]
"""Left, top, right and bottom side of a rectangle [pixel]."""
Colour = tuple[int, int, int]
"""Blue, green and red, 0 to 255."""


def draw_picture(content: PictureContent) -> NDArray[np.uint8]:
    """Return a picture `(H, PICTURE_WIDTH, 3)`, RGB."""
    image_bgr = content.image[:, :, ::-1]
    height, width = image_bgr.shape[:2]
    scale = PICTURE_WIDTH / width
    size = (PICTURE_WIDTH, round(height * scale))
    shaded_image = _shade_occlusions(image_bgr, content.visible)
    image_with_boxes = _draw_boxes(cv2.resize(shaded_image, size).astype(np.uint8), content, scale)
    status_bar = draw_status_bar(content, PICTURE_WIDTH)
    if content.selected_index is not None:
        selected = content.detections[content.selected_index]
        colour = choose_class_colour(selected.label, content.classes)
        status_bar[:, :STATUS_BAR_HEIGHT] = _draw_close_up(image_bgr, selected.box, colour)
    return np.vstack([image_with_boxes, status_bar])[:, :, ::-1]


def _shade_occlusions(image: NDArray[np.uint8], visible: NDArray[np.bool_] | None) -> NDArray[np.uint8]:
    """Return the image `(H, W, 3)` with shaded pixels where the mask `visible` `(H, W)` is False."""
    if visible is None or visible.all():
        return image
    shaded_image = image.copy()
    background = np.array(to_bgr(BACKGROUND))
    shaded_image[~visible] = (1 - SHADING_FRACTION) * image[~visible] + SHADING_FRACTION * background
    return shaded_image


def _draw_close_up(image: NDArray[np.uint8], box: Sequence[float], colour: str) -> NDArray[np.uint8]:
    """Return the enlarged square region around a box, `(STATUS_BAR_HEIGHT, STATUS_BAR_HEIGHT, 3)` BGR."""
    left, top, right, bottom = box
    side = max(2.0, CLOSE_UP_SCALE * max(right - left, bottom - top))
    zoom = STATUS_BAR_HEIGHT / side
    corner = np.array([(left + right) / 2, (top + bottom) / 2]) - side / 2
    # The matrix maps the upper left corner of the square to (0, 0).
    matrix = np.array([[zoom, 0.0, -zoom * corner[0]], [0.0, zoom, -zoom * corner[1]]])
    size, border = (STATUS_BAR_HEIGHT, STATUS_BAR_HEIGHT), to_bgr(BACKGROUND)
    close_up = cv2.warpAffine(image, matrix, size, flags=cv2.INTER_CUBIC, borderValue=border)
    edge = STATUS_BAR_HEIGHT - 2
    cv2.rectangle(close_up, (1, 1), (edge, edge), to_bgr(colour), SELECTED_LINE_WIDTH)
    return close_up.astype(np.uint8)


def _draw_boxes(image: NDArray[np.uint8], content: PictureContent, scale: float) -> NDArray[np.uint8]:
    """Return `image`, which is already scaled by `scale`, with all boxes; the selected box is drawn last."""
    colours = [to_bgr(choose_class_colour(each.label, content.classes)) for each in content.detections]
    boxes = [[int(side * scale) for side in each.box] for each in content.detections]
    selected = content.selected_index
    layers = [(index, colours[index], LINE_WIDTH) for index in range(len(boxes)) if index != selected]
    if selected is not None:
        layers.append((selected, to_bgr(OUTLINE), SELECTED_LINE_WIDTH + 2 * OUTLINE_WIDTH))
        layers.append((selected, colours[selected], SELECTED_LINE_WIDTH))
    for index, colour, line_width in layers:
        left, top, right, bottom = boxes[index]
        cv2.rectangle(image, (left, top), (right, bottom), colour, line_width)
    placed: list[Rectangle] = []
    for (left, top, _, _), caption, colour in zip(boxes, make_captions(content), colours, strict=True):
        placed.append(_draw_caption(image, (left, top), caption, colour, placed))
    return image


def make_captions(content: PictureContent) -> list[str]:
    """Return the caption of each box: name of the item or class, and confidence of the detection."""
    names = [detection.label for detection in content.detections]
    if content.selected_index is not None:
        names[content.selected_index] = content.item or names[content.selected_index]
    return [f"{name} {each.confidence:.2f}" for name, each in zip(names, content.detections, strict=True)]


def _draw_caption(
    image: NDArray[np.uint8], corner: tuple[int, int], text: str, colour: Colour, others: Sequence[Rectangle]
) -> Rectangle:
    """Draw the caption of a box, and return its rectangle; the caption is black on the colour of the class.

    `corner` is the upper left corner of the box [pixel]; `others` are the rectangles of the other captions.
    `supervision` draws captions, too, but its import takes 0.8 to 2 s.
    """
    (text_width, text_height), _ = cv2.getTextSize(text, FONT, TEXT_SCALE, 1)
    size = text_width + 2 * PADDING, text_height + 2 * PADDING
    left, top, right, bottom = place_caption(corner, size, (image.shape[1], image.shape[0]), others)
    cv2.rectangle(image, (left, top), (right, bottom), colour, cv2.FILLED)
    origin = left + PADDING, top + PADDING + text_height
    cv2.putText(image, text, origin, FONT, TEXT_SCALE, BLACK, 1, cv2.LINE_AA)
    return left, top, right, bottom


def place_caption(
    corner: tuple[int, int], size: tuple[int, int], image_size: tuple[int, int], others: Sequence[Rectangle]
) -> Rectangle:
    """Return the rectangle of a caption in the image, near `corner` and beside the other captions.

    Arguments are in pixels. If no place near the corner is free, the caption covers other captions.
    """
    (width, height), max_top = size, image_size[1] - size[1]
    left = max(0, min(corner[0], image_size[0] - width))
    preferred_top = max(0, min(corner[1] - height, max_top))
    obstacles = [each for each in others if each[0] < left + width + MIN_GAP and left < each[2] + MIN_GAP]
    tops = [preferred_top, *(bottom + MIN_GAP for _, _, _, bottom in obstacles)]
    tops += [top - MIN_GAP - height for _, top, _, _ in obstacles]
    free_tops = (
        top
        for top in sorted(tops, key=lambda top: abs(top - preferred_top))
        if 0 <= top <= max_top
        and all(top + height + MIN_GAP <= each[1] or each[3] + MIN_GAP <= top for each in obstacles)
    )
    top = next(free_tops, preferred_top)
    return left, top, left + width, top + height
