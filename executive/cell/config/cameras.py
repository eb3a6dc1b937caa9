"""Sections of a cell file: cameras with noise and depth sensor."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from executive.cell.config.calibration import CalibrationConfig
from executive.cell.config.section import Distance, Fraction, Length, Name, Natural, Section, Vector

POSE_AND_FOV_KEYS = ("position", "look_at", "up", "fov_deg")
"""Keys that a camera without a calibration needs for its pose and field of view."""


class NoiseConfig(Section):
    """Image noise of a camera, sampled for each frame with the seed of the run."""

    gain: Fraction = 0.02
    """Standard deviation of the random brightness factor of a frame; the mean of the factor is 1."""
    read: float = Field(2.0, ge=0, le=255)
    """Standard deviation of the noise of each pixel [grey level, 0 to 255]."""


class DepthConfig(Section):
    """A depth sensor registered to the camera, and its noise, sampled for each frame.

    The defaults model a RealSense D435 at 848 x 480 (focal length 425 pixels, baseline 50 mm). According to
    Intel's "Tuning depth cameras for best performance", the RMS error of a stereo camera at distance z is
    z² · subpixel error / (focal length · baseline); the subpixel error is 0.08 pixel. The dropout fractions
    and the correlation of neighbouring pixels are assumed.
    """

    floor: Distance = 0.0005
    """Standard deviation of the noise at distance 0 [m]."""
    growth: Fraction = 0.0038
    """Quadratic coefficient [1/m]: the standard deviation of the noise is floor + growth · distance²."""
    grain: float = Field(1.0, ge=0, le=100)
    """Standard deviation of the Gaussian kernel that smooths the noise [pixel]; 0: independent pixels."""
    step: Distance = 0.001
    """Resolution of the distances [m]; 0: exact distances."""
    edge: Length = 0.02
    """Minimum difference between the distances of neighbouring pixels that counts as an edge [m]."""
    edge_width: Natural = 2
    """Maximum distance from an edge at which `edge_dropout` applies [pixel]."""
    edge_dropout: Fraction = 0.7
    """Fraction of the pixels near an edge that have no measurement."""
    dropout: Fraction = 0.01
    """Fraction of all pixels that have no measurement."""


class CameraConfig(Section):
    """A camera, fixed in the world or mounted on the wrist.

    Pose and field of view are defined by `position`, `look_at`, `up` and `fov_deg`, or by `calibration`.
    """

    mount: Literal["fixed", "wrist"]
    """`fixed`: the pose is in the world frame. `wrist`: the pose is in the frame of the flange."""
    position: Vector | None = None
    """Optical centre: x, y, z [m]."""
    look_at: Vector | None = None
    """A point on the optical axis: x, y, z [m]."""
    up: Vector | None = None
    """Direction of the top of the image: x, y, z."""
    width: int = Field(640, ge=64, le=8192)
    """Image width [pixel]."""
    height: int = Field(480, ge=64, le=8192)
    """Image height [pixel]."""
    fov_deg: float | None = Field(None, gt=1, lt=179)
    """Vertical field of view [degree]."""
    calibration: CalibrationConfig | None = None
    """Camera matrix and pose, instead of `position`, `look_at`, `up` and `fov_deg`."""
    table_view: tuple[int, int, int, int]
    """Square region of the image that shows the workspace: left, top, right and bottom side [pixel]."""
    scan_poses: tuple[Name, ...] = Field(min_length=1)
    """Arm poses from which the camera sees the table, best first."""
    partial_views: bool = False
    """True if the camera shows only a part of the workspace from each scan pose, and all of it from all
    scan poses together. Objects at the border of an image are then ignored, because the image cuts them."""
    noise: NoiseConfig = NoiseConfig()
    """Image noise."""
    depth: DepthConfig | None = None
    """Depth sensor; by default there is none. `depth: {}` is a depth sensor with the default noise."""

    def get_view_box(self, view: str) -> tuple[int, int, int, int]:
        """Return the region of the image [pixel] that a view shows: `table` (the workspace) or `full`."""
        return self.table_view if view == "table" else (0, 0, self.width, self.height)

    @model_validator(mode="after")
    def _check_view_and_pose(self) -> CameraConfig:
        left, top, right, bottom = self.table_view
        is_inside = 0 <= left < right <= self.width and 0 <= top < bottom <= self.height
        if not is_inside or right - left != bottom - top:
            raise ValueError(
                f"needs a table_view that is a square inside its image of {self.width} x {self.height} "
                f"pixels, not {list(self.table_view)}"
            )
        present = [key for key in POSE_AND_FOV_KEYS if getattr(self, key) is not None]
        if self.calibration is not None and present:
            raise ValueError(f"must not have {', '.join(present)} besides calibration, which defines them")
        image = f"{self.width} x {self.height}"
        calibration = self.calibration
        if calibration and calibration.width and image != f"{calibration.width} x {calibration.height}":
            raise ValueError(
                f"has images of {image} pixels, but its calibration is for {calibration.width} x "
                f"{calibration.height}; correct width and height, or calibrate at this resolution"
            )
        if self.calibration is None and len(present) < len(POSE_AND_FOV_KEYS):
            missing = ", ".join(key for key in POSE_AND_FOV_KEYS if key not in present)
            raise ValueError(f"needs {missing}, or a calibration instead of {', '.join(POSE_AND_FOV_KEYS)}")
        if self.position is not None and self.look_at is not None and self.up is not None:
            axis = np.subtract(self.look_at, self.position)
            if np.linalg.norm(np.cross(axis, self.up)) < 1e-9:
                raise ValueError("needs a look_at other than position, and an up that is not along the axis")
        return self
