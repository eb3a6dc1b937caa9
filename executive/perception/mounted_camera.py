"""Base class of the cameras of cells: pose, calibration, and numbering of frames."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import CameraConfig
from executive.cell.frame import Box, Frame
from executive.cell.protocols import Clock
from executive.geometry import Array, Pose
from executive.perception.camera_model import compute_calibration

BORDER_FRACTION = 0.05
"""Width of the ignored border of an image with a partial view, as a fraction of the height of the image.

If the image cuts an object that spans at most a sixth of the height, over 30 % of its box lie in the border.
"""


class MountedCamera:
    """Base class of cameras, with frames numbered from 1; implements part of `cell.protocols.Camera`.

    Args:
        name: Name of the camera in the cell file.
        config: Section of the camera in the cell file.
        get_flange_pose: Function that returns the pose `X_WF` of the flange, the mount of a wrist camera.
        clock: Clock of the run, for the capture times of frames.
        get_change_count: Function that returns how often the robot has changed the objects on the table.

    Attributes:
        name: Name of the camera in the cell file.
        config: Section of the camera in the cell file.
        matrix: Camera matrix `(3, 3)` [pixel].
        scan_poses: Names of the arm poses from which the camera sees the table; the first has the best view.
    """

    def __init__(
        self,
        name: str,
        config: CameraConfig,
        get_flange_pose: Callable[[], Pose],
        clock: Clock,
        get_change_count: Callable[[], int] = lambda: 0,
    ) -> None:
        self.name, self.config, self._clock, self._get_change_count = name, config, clock, get_change_count
        self.matrix, self._X_MC = compute_calibration(config)
        self._get_flange_pose = get_flange_pose
        self.scan_poses, self._size = config.scan_poses, (config.width, config.height)
        self._frame_count = self._pose_count = 0
        self._content_mask = np.ones((config.height, config.width), dtype=bool)
        """Mask `(H, W)` of the pixels that are not in the ignored border of an image with a partial view."""
        if config.partial_views:
            width = round(BORDER_FRACTION * config.height)
            self._content_mask = np.pad(self._content_mask[width:-width, width:-width], width)

    def next_pose(self) -> str:
        """Advance to the next scan pose, cyclically, and return its name."""
        self._pose_count += 1
        return self.scan_poses[self._pose_count % len(self.scan_poses)]

    def get_view_box(self, view: str) -> Box:
        """Return the region of interest in the image [pixel] for a view: `table` or `full`."""
        return self.config.get_view_box(view)

    def capture(self) -> Frame:
        """Capture and return a frame."""
        self._frame_count += 1
        X_WC = self._compute_pose()
        image, depth = self._capture_images()
        return Frame(
            id=self._frame_count,
            camera=self.name,
            image=image,
            depth=depth,
            matrix=self.matrix,
            X_WC=X_WC,
            stamp=self._clock.now,
            visible=self._compute_visibility_mask(X_WC) & self._content_mask,
            change_count=self._get_change_count(),
        )

    def _capture_images(self) -> tuple[NDArray[np.uint8], Array | None]:
        """Return the image `(H, W, 3)` and the depth `(H, W)` [m] of a new frame."""
        raise NotImplementedError

    def _compute_visibility_mask(self, X_WC: Pose) -> NDArray[np.bool_]:
        """Return the mask `(H, W)` of the pixels that the arm does not occlude."""
        raise NotImplementedError

    def set_counts(self, frame_count: int, pose_count: int) -> None:
        """Set the counters of captured frames and of calls of `next_pose` when a run is resumed."""
        self._frame_count, self._pose_count = frame_count, pose_count

    def _compute_pose(self) -> Pose:
        """Return the current pose `X_WC` of the camera."""
        return self._X_MC if self.config.mount == "fixed" else self._get_flange_pose() @ self._X_MC
