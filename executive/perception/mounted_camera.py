"""Base class of the cameras of cells: pose, calibration and numbering of frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import CameraConfig
from executive.cell.frame import Box, Frame
from executive.cell.protocols import Clock
from executive.geometry import Array, Pose
from executive.perception.camera_model import compute_calibration


class MountedCamera:
    """Base of the cameras of cells, with frames numbered from 1; implements part of `cell.protocols.Camera`.

    Args:
        name: Name of the camera in the cell file.
        config: Section of the camera in the cell file.
        flange: Returns the pose of the arm's flange, on which a wrist camera is mounted.
        clock: Clock of the run, for the capture times of frames.
        epoch: Returns the number of changes of the table.

    Attributes:
        name: Name of the camera in the cell file.
        config: Section of the camera in the cell file.
        matrix: Camera matrix `(3, 3)` [pixel].
    """

    def __init__(
        self,
        name: str,
        config: CameraConfig,
        flange: Callable[[], Pose],
        clock: Clock,
        epoch: Callable[[], int] = lambda: 0,
    ) -> None:
        self.name, self.config, self._clock, self._epoch = name, config, clock, epoch
        self.matrix, self._X_MC = compute_calibration(config)
        self._flange = flange
        self._frames = self._turn = 0

    @property
    def scan_poses(self) -> Sequence[str]:
        """Names of the arm poses from which the camera sees the table, best first."""
        return self.config.scan_poses

    def next_pose(self) -> str:
        """Advance to the next scan pose and return its name."""
        self._turn += 1
        return self.scan_poses[self._turn % len(self.scan_poses)]

    def get_view_box(self, view: str) -> Box:
        """Return the box [pixel] of a view of the image: `table` or `full`."""
        return self.config.get_view_box(view)

    def capture(self) -> Frame:
        """Capture a frame."""
        self._frames += 1
        X_WC = self._pose()
        image, depth = self._capture_images()
        return Frame(
            id=self._frames,
            camera=self.name,
            image=image,
            depth=depth,
            matrix=self.matrix,
            X_WC=X_WC,
            stamp=self._clock.now,
            visible=self._compute_visibility_mask(X_WC),
            epoch=self._epoch(),
        )

    def _capture_images(self) -> tuple[NDArray[np.uint8], Array | None]:
        """Return the image `(H, W, 3)` and the depth `(H, W)` [m] of a new frame."""
        raise NotImplementedError

    def _compute_visibility_mask(self, X_WC: Pose) -> NDArray[np.bool_]:
        """Return the mask `(H, W)` of the pixels in which the arm does not hide the scene."""
        raise NotImplementedError

    def skip(self, frames: int, turns: int) -> None:
        """Count `frames` captured frames and `turns` calls of `next_pose`, for the resumption of a run."""
        self._frames, self._turn = frames, turns

    def _pose(self) -> Pose:
        return self._X_MC if self.config.mount == "fixed" else self._flange() @ self._X_MC
