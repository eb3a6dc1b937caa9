"""Camera image with camera pose, capture time and visibility mask."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from executive.events import Event
from executive.geometry import Array, Pose

Box = tuple[float, float, float, float]
"""Left, top, right and bottom side [pixel] of a box in an image; pixel i covers [i, i + 1)."""

TYPICAL_OBJECT_POINTS = 0.03 * np.array([(0, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)])
"""Points `(5, 3)` [m] of a typical object relative to its centre: the centre and four outline points."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One camera image with the pose of the camera at capture.

    Attributes:
        id: Number of the frame in this run, unique over all cameras.
        camera: Name of the camera.
        image: Image `(H, W, 3)` uint8, RGB.
        depth: Depth image `(H, W)` [m] along the optical axis, NaN for pixels without a measurement; None
            for a camera without a depth sensor.
        matrix: Camera matrix `(3, 3)` [pixel].
        X_WC: Camera pose in the world at capture, in the convention of OpenCV (z forward, y down).
        stamp: Capture time on the clock of the run [s].
        visible: Mask `(H, W)`, False for pixels that the arm may occlude at its measured joint positions, and
            for pixels at the border of an image with a partial view (`CameraConfig.partial_views`).
        change_count: Number of robot actions that may have moved objects before the capture.
    """

    id: int
    camera: str
    image: NDArray[np.uint8]
    depth: Array | None
    matrix: Array
    X_WC: Pose
    stamp: float
    visible: NDArray[np.bool_]
    change_count: int

    def compute_visible_fraction(self, box: Box) -> float:
        """Return the fraction of a box (0 to 1) that the arm does not occlude."""
        height, width = self.visible.shape
        left, right = (min(max(round(x), 0), width) for x in box[::2])
        top, bottom = (min(max(round(y), 0), height) for y in box[1::2])
        crop = self.visible[top:bottom, left:right]
        return float(crop.mean()) if crop.size else 0.0

    def compute_area_mask(self, points: Array, area: Box, margin: float = 0.0) -> NDArray[np.bool_]:
        """Return a mask `(N,)` of the points whose projections lie in a region of the image.

        Args:
            points: Points in the world `(N, 3)` [m].
            area: Region of the image [pixel].
            margin: Minimum distance of a projection from the border of the region [pixel].
        """
        x, y, is_in_front = self._project(points)
        left, top, right, bottom = area
        is_inside_x = (left + margin <= x) & (x < right - margin)
        is_inside_y = (top + margin <= y) & (y < bottom - margin)
        return np.asarray(is_in_front & is_inside_x & is_inside_y)

    def compute_unoccluded_mask(self, points: Array) -> NDArray[np.bool_]:
        """Return a mask `(N,)` of the points `(N, 3)` [m] where the arm would hide no part of an object.

        A typical object is assumed at each point. A point outside the image counts as the nearest pixel.
        """
        mask = np.ones(len(points), dtype=bool)
        height, width = self.visible.shape
        for offset in TYPICAL_OBJECT_POINTS:
            x, y, is_in_front = self._project(points + offset)
            columns, rows = x.astype(int).clip(0, width - 1), y.astype(int).clip(0, height - 1)
            mask &= is_in_front & self.visible[rows, columns]
        return mask

    def compute_depth(self, position: Array) -> float:
        """Return the distance [m] of a world point `(3,)` [m] from the camera, along the optical axis."""
        return float(self.X_WC.inverse().apply(position)[2])

    def to_opencv(self) -> tuple[Array, Array, Array]:
        """Return the camera parameters of OpenCV: matrix `(3, 3)`, rvec `(3,)` [rad] and tvec `(3,)` [m].

        Add 0.5 to each result of `cv2.projectPoints(points, rvec, tvec, matrix, None)`, because pixel centres
        have integer coordinates in OpenCV; in this project, pixel i covers [i, i + 1).
        """
        matrix = self.matrix.copy()
        matrix[:2, 2] -= 0.5
        X_CW = self.X_WC.inverse()
        return matrix, X_CW.rotation_vector, X_CW.position

    def _project(self, points: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Return x, y `(N,)` [pixel] of points `(N, 3)` [m], and a mask of points in front of the camera."""
        X_CW = self.X_WC.inverse()
        x, y, depth = self.matrix @ X_CW.rotation @ points.T + (self.matrix @ X_CW.position)[:, None]
        # A division by infinity avoids warnings for points behind the camera.
        divisor = np.where(depth > 0, depth, np.inf)
        return x / divisor, y / divisor, depth > 0


@dataclass(frozen=True)
class FrameCaptured(Event):
    """A frame was captured. The journal does not contain this event, because the image is too large.

    Attributes:
        frame: The frame with its image.
    """

    is_recorded = False
    frame: Frame
