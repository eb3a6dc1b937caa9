"""Cameras and their sensors."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from executive.cell.config.section import Distance, GreyLevels, Length, Name, Natural, Section, Share, Vector

Pixels = Annotated[float, Field(ge=-1e5, le=1e5)]
"""An entry of a camera matrix [pixel]; with 100,000 pixels, a frame 640 pixels wide spans 0.4 degrees."""
Row = tuple[Pixels, Pixels, Pixels]
Turn = Annotated[float, Field(ge=-7, le=7)]
"""A component of a rotation vector [rad], at most a whole turn."""

POSE_AND_FOV_KEYS = ("position", "look_at", "up", "fov_deg")
"""Keys that say how a camera stands and sees where no calibration does."""


class NoiseConfig(Section):
    """Sensor noise of a camera, drawn anew for every frame from the run's seed."""

    gain: Share = 0.02
    """Standard deviation of a frame's brightness factor."""
    read: GreyLevels = 2.0
    """Standard deviation of a pixel's value [grey level of 255]."""


class DepthConfig(Section):
    """A depth sensor in register with the camera, and its noise, drawn anew for every frame.

    The defaults stand for a RealSense D435 at 848 x 480 (focal length 425 pixels, baseline 50 mm). By
    Intel's "Tuning depth cameras for best performance" the RMS error of a stereo camera is
    z² · subpixel / (focal length · baseline); a subpixel error of 0.08 is taken. What is lost and where,
    and over how many pixels it errs alike, is assumed.
    """

    floor: Distance = 0.0005
    """Standard deviation right before the lens [m]."""
    growth: Share = 0.0038
    """What the square of the distance adds to it [1/m]: at distance z it is floor + growth · z²."""
    grain: float = Field(1.0, ge=0, le=100)
    """Standard deviation of the window over which neighbours err alike [pixel]; 0: every one for itself."""
    step: Distance = 0.001
    """Distances are whole multiples of this [m]; 0: not rounded."""
    edge: Length = 0.02
    """Difference of neighbours that is an edge, where the sensor may see nothing [m]."""
    edge_width: Natural = 2
    """How far from an edge that happens [pixel]."""
    edge_dropout: Share = 0.7
    """Share of the pixels there without a distance."""
    dropout: Share = 0.01
    """Share of the pixels without a distance everywhere."""


class TransformConfig(Section):
    """A change of frame as OpenCV writes it: p' = R p + t."""

    rotation: tuple[Turn, Turn, Turn]
    """Rotation vector, the axis times the angle [rad]: OpenCV's rvec; `cv2.Rodrigues` makes it of R."""
    translation: Vector
    """OpenCV's tvec t."""


class CalibrationConfig(Section):
    """Camera matrix and pose as OpenCV's calibration gives them, of images without distortion."""

    matrix: tuple[Row, Row, Row]
    """[[fx, 0, cx], [0, fy, cy], [0, 0, 1]] [pixel]; as in OpenCV, pixel centres are whole numbers."""
    mount_to_camera: TransformConfig | None = None
    """From the world (a fixed camera) or the flange (one on the wrist) to it, as `cv2.solvePnP` gives it."""
    camera_to_mount: TransformConfig | None = None
    """The inverse of `mount_to_camera`, as `cv2.calibrateHandEye` gives it; one of the two must be there."""

    @model_validator(mode="after")
    def _is_of_a_camera(self) -> CalibrationConfig:
        (fx, skew, _), (zero, fy, _), last = self.matrix
        if fx <= 0 or fy <= 0 or (skew, zero) != (0, 0) or last != (0, 0, 1):
            raise ValueError(
                "needs a matrix [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] with fx and fy above 0, "
                f"not {[list(row) for row in self.matrix]}"
            )
        if (self.mount_to_camera is None) == (self.camera_to_mount is None):
            raise ValueError(
                "needs either mount_to_camera or camera_to_mount, the one being the other's inverse"
            )
        return self


class CameraConfig(Section):
    """A camera, fixed in the world or mounted on the wrist.

    How it stands and sees is said by `position`, `look_at`, `up` and `fov_deg`, or by its `calibration`.
    """

    mount: Literal["fixed", "wrist"]
    """`fixed`: where it is said to be is in the world. `wrist`: it is in the flange's frame."""
    position: Vector | None = None
    """Optical centre."""
    look_at: Vector | None = None
    """A point on the optical axis."""
    up: Vector | None = None
    """Direction that the top of the image shows."""
    width: int = Field(640, ge=64, le=8192)
    """Image width [pixel]."""
    height: int = Field(480, ge=64, le=8192)
    """Image height [pixel]."""
    fov_deg: float | None = Field(None, gt=1, lt=179)
    """Vertical field of view [degree]."""
    calibration: CalibrationConfig | None = None
    """Camera matrix and pose, instead of `position`, `look_at`, `up` and `fov_deg`."""
    table_view: tuple[int, int, int, int]
    """Left, top, right, bottom [pixel] of the square part of the image that shows the workspace."""
    scan_poses: tuple[Name, ...] = Field(min_length=1)
    """Arm poses from which it sees the table, best first."""
    noise: NoiseConfig = NoiseConfig()
    """Its sensor noise."""
    depth: DepthConfig | None = None
    """Its depth sensor; none by default. `depth: {}` is one with the usual noise."""

    def area(self, view: str) -> tuple[int, int, int, int]:
        """Return the part of the image [pixel] that `view` (`table` or `full`) means."""
        return self.table_view if view == "table" else (0, 0, self.width, self.height)

    @model_validator(mode="after")
    def _can_be_set_up(self) -> CameraConfig:
        left, top, right, bottom = self.table_view
        square = 0 <= left < right <= self.width and 0 <= top < bottom <= self.height
        if not square or right - left != bottom - top:
            raise ValueError(
                f"needs a table_view that is a square inside its image of {self.width} x {self.height} "
                f"pixels, not {list(self.table_view)}"
            )
        given = [key for key in POSE_AND_FOV_KEYS if getattr(self, key) is not None]
        if self.calibration is not None and given:
            raise ValueError(f"needs no {', '.join(given)} where it has a calibration, which says it all")
        if self.calibration is None and len(given) < len(POSE_AND_FOV_KEYS):
            lacking = ", ".join(key for key in POSE_AND_FOV_KEYS if key not in given)
            raise ValueError(f"needs {lacking}, or a calibration instead of {', '.join(POSE_AND_FOV_KEYS)}")
        if self.position is not None and self.look_at is not None and self.up is not None:
            axis = np.subtract(self.look_at, self.position)
            if np.linalg.norm(np.cross(axis, self.up)) < 1e-9:
                raise ValueError("needs a look_at other than its position, and an up that is not on its axis")
        return self
