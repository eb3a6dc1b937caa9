"""Poses of cameras in tests."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from executive.geometry import Pose


def looking_down(position: ArrayLike, up: Sequence[float] = (1.0, 0.0, 0.0)) -> Pose:
    """Return the camera pose `X_WC` at `position` looking straight down.

    OpenCV's convention: z along the optical axis, x to the image's right, y to its bottom. `up` is
    the world direction that the top of the image shows.
    """
    z = np.array([0.0, 0.0, -1.0])
    y = -np.asarray(up, dtype=float) / np.linalg.norm(up)
    return Pose(np.column_stack([np.cross(y, z), y, z]), np.asarray(position, dtype=float))
