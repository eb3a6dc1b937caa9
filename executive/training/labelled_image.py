"""Image with labelled objects, and what its renderer knows about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from executive.cell.frame import Box, Frame
from executive.geometry import Array, Pose

MIN_BORDER_DISTANCE = 0.5
"""Distance from the border of the searched area [pixel] from which an object is wholly in view."""
MIN_VISIBLE_FRACTION = 0.9
"""Visible share of the silhouette from which an object is in full view."""


@dataclass(frozen=True, eq=False)
class LabelledImage:
    """An image and the objects in it.

    Attributes:
        file: File name.
        image: `(H, W, 3)` uint8, RGB.
        labels: Class of each object.
        boxes: Box of each object [pixel].
        ignored: Boxes of objects that a detector may find or not.
        truth: Further knowledge of the renderer: `camera`, `part`, `matrix`, `X_WC`, `positions`, …
        area: Part of the image [pixel] that is searched and labelled; None: all of it.
        depth: `(H, W)` [m], as in a `Frame`; None without a depth sensor.
        second: Another image of the same scene from the same pose; None without one.
    """

    file: str
    image: NDArray[np.uint8]
    labels: tuple[str, ...]
    boxes: tuple[Box, ...]
    ignored: tuple[Box, ...] = ()
    truth: Mapping[str, Any] = field(default_factory=dict)
    area: Box | None = None
    depth: Array | None = None
    second: NDArray[np.uint8] | None = None

    def as_frame(self, number: int) -> Frame:
        """Return the image as a frame of a camera that sees exactly this; with the true pose if known."""
        is_known = "matrix" in self.truth and "X_WC" in self.truth
        return Frame(
            id=number,
            camera=str(self.truth.get("camera", "image")),
            image=self.image,
            depth=self.depth,
            matrix=self._matrix() if is_known else np.eye(3),
            X_WC=Pose.of(self.truth["X_WC"][:3], self.truth["X_WC"][3:]) if is_known else Pose.identity(),
            stamp=0.0,
            visible=np.ones(self.image.shape[:2], np.bool_),
            epoch=0,
        )

    def is_whole(self, number: int) -> bool:
        """Return True if an object lies wholly in the searched area."""
        box, (left, top, right, bottom) = self.boxes[number], self.area or self._bounds
        distance = min(box[0] - left, box[1] - top, right - box[2], bottom - box[3])
        return distance >= MIN_BORDER_DISTANCE

    def visible_fraction(self, number: int) -> float:
        """Return the visible share of an object, 0 to 1; 1 if it is unknown."""
        shares = self.truth.get("visible_fraction")
        return 1.0 if shares is None else float(shares[number])

    def is_in_full_view(self, number: int) -> bool:
        """Return True if an object lies wholly in the searched area, and hardly anything hides it."""
        return self.is_whole(number) and self.visible_fraction(number) >= MIN_VISIBLE_FRACTION

    @property
    def pixel_size(self) -> Array:
        """Width and height of the image's pixels `(2,)` in pixels of the camera's whole frame."""
        _, _, width, height = self._bounds
        left, top, right, bottom = self.truth.get("part", self._bounds)
        return np.array([(right - left) / width, (bottom - top) / height])

    @property
    def _bounds(self) -> tuple[int, int, int, int]:
        height, width = self.image.shape[:2]
        return 0, 0, width, height

    def _matrix(self) -> Array:
        """Return the camera matrix of the part of the camera's image that this image shows."""
        left, top, *_ = self.truth.get("part", (0, 0))
        shifted = np.array(self.truth["matrix"], dtype=float)
        shifted[:2, 2] -= left, top
        shifted[:2] /= self.pixel_size[:, None]
        return shifted
