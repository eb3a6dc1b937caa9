"""Image with labelled objects, and the ground truth of its renderer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from executive.cell.frame import Box, Frame
from executive.geometry import Array, Pose

MIN_BORDER_DISTANCE = 0.5
"""Minimum distance of the box of a complete object from the border of the searched region [pixel]."""
MIN_VISIBLE_FRACTION = 0.9
"""Minimum visible fraction of the silhouette of an object that counts as fully visible."""


@dataclass(frozen=True, eq=False)
class LabelledImage:
    """An image and the objects in it.

    Attributes:
        file: File name of the image.
        image: Image `(H, W, 3)` uint8, RGB.
        labels: Class of each object.
        boxes: Box of each object [pixel].
        ignored_boxes: Boxes of objects that evaluations ignore, whether detected or missed [pixel].
        truth: Ground truth of the renderer, for instance `X_WC` and `positions`. The key `part` contains the
            region of the camera's full frame that the image shows [pixel].
        region: Region of the image [pixel] that is searched and labelled; None: the whole image.
        depth: Depth image `(H, W)` [m] in the format of `Frame.depth`; None without a depth sensor.
        repeated_image: Image of the same scene from the same camera pose with different noise, or None.
    """

    file: str
    image: NDArray[np.uint8]
    labels: tuple[str, ...]
    boxes: tuple[Box, ...]
    ignored_boxes: tuple[Box, ...] = ()
    truth: Mapping[str, Any] = field(default_factory=dict)
    region: Box | None = None
    depth: Array | None = None
    repeated_image: NDArray[np.uint8] | None = None

    def to_frame(self, frame_id: int) -> Frame:
        """Return the image as a frame, with the true camera pose if the pose is known."""
        matrix, X_WC = np.eye(3), Pose.identity()
        if "matrix" in self.truth and "X_WC" in self.truth:
            matrix = self._compute_camera_matrix()
            X_WC = Pose.of(self.truth["X_WC"][:3], self.truth["X_WC"][3:])
        camera, visible = str(self.truth.get("camera", "image")), np.ones(self.image.shape[:2], np.bool_)
        return Frame(frame_id, camera, self.image, self.depth, matrix, X_WC, 0.0, visible, change_count=0)

    def is_fully_inside(self, index: int) -> bool:
        """Return True if the object with the given index lies completely in the searched region."""
        box, (left, top, right, bottom) = self.boxes[index], self.region or self._image_region
        distance = min(box[0] - left, box[1] - top, right - box[2], bottom - box[3])
        return distance >= MIN_BORDER_DISTANCE

    def get_visible_fraction(self, index: int) -> float:
        """Return the visible fraction of an object, 0 to 1; 1 if the fraction is unknown."""
        fractions = self.truth.get("visible_fraction")
        return 1.0 if fractions is None else float(fractions[index])

    def is_fully_visible(self, index: int) -> bool:
        """Return True if an object lies completely in the searched region and is almost unoccluded."""
        return self.is_fully_inside(index) and self.get_visible_fraction(index) >= MIN_VISIBLE_FRACTION

    @property
    def pixel_scale(self) -> Array:
        """Number of pixels of the camera's full frame per pixel of this image, along x and y `(2,)`."""
        _, _, width, height = self._image_region
        left, top, right, bottom = self.truth.get("part", self._image_region)
        return np.array([(right - left) / width, (bottom - top) / height])

    @property
    def _image_region(self) -> tuple[int, int, int, int]:
        """Left, top, right and bottom of the whole image [pixel]."""
        height, width = self.image.shape[:2]
        return 0, 0, width, height

    def _compute_camera_matrix(self) -> Array:
        """Return the camera matrix `(3, 3)` of this image, which may be a scaled part of a frame."""
        left, top, *_ = self.truth.get("part", (0, 0))
        matrix = np.array(self.truth["matrix"], dtype=float)
        matrix[:2, 2] -= left, top
        matrix[:2] /= self.pixel_scale[:, None]
        return matrix
