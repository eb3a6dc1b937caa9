"""Cameras and their sensors."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from executive.cell_config.section import Section, Vector


class NoiseConfig(Section):
    """Sensor noise of a camera, drawn anew for every frame from the run's seed."""

    gain: float = Field(0.02, ge=0)
    """Standard deviation of a frame's brightness factor."""
    read: float = Field(2.0, ge=0)
    """Standard deviation of a pixel's value [grey level of 255]."""


class CameraConfig(Section):
    """A camera, fixed in the world or mounted on the wrist."""

    mount: Literal["fixed", "wrist"]
    """`fixed`: `position` and `look_at` are in the world. `wrist`: they are in the flange's frame."""
    position: Vector
    """Optical centre."""
    look_at: Vector
    """A point on the optical axis."""
    up: Vector
    """Direction that the top of the image shows."""
    width: int = Field(640, ge=64)
    """Image width [pixel]."""
    height: int = Field(480, ge=64)
    """Image height [pixel]."""
    fov_deg: float = Field(gt=1, lt=179)
    """Vertical field of view [degree]."""
    table_view: tuple[int, int, int, int]
    """Left, top, right, bottom [pixel] of the square part of the image that shows the workspace."""
    scan_poses: tuple[str, ...] = Field(min_length=1)
    """Arm poses from which it sees the table, best first."""
    noise: NoiseConfig = NoiseConfig()
    """Its sensor noise."""

    @model_validator(mode="after")
    def _can_be_set_up(self) -> CameraConfig:
        left, top, right, bottom = self.table_view
        square = 0 <= left < right <= self.width and 0 <= top < bottom <= self.height
        if not square or right - left != bottom - top:
            raise ValueError(
                f"needs a table_view that is a square inside its image of {self.width} x {self.height} "
                f"pixels, not {list(self.table_view)}"
            )
        if np.linalg.norm(np.cross(np.subtract(self.look_at, self.position), self.up)) < 1e-9:
            raise ValueError("needs a look_at other than its position, and an up that is not on its axis")
        return self
