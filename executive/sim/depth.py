"""What a depth sensor makes of true distances."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell_config import DepthConfig
from executive.geometry import Array
from executive.vision.camera_model import FAR, NEAR


def distances(buffer: NDArray[np.float32]) -> Array:
    """Return the distances along the optical axis [m] of OpenGL's depth buffer, 0 to 1; inf beyond `FAR`."""
    with np.errstate(divide="ignore"):
        return np.where(buffer < 1.0, FAR * NEAR / (FAR - (FAR - NEAR) * buffer.astype(np.float64)), np.inf)


def sense(true: Array, config: DepthConfig, rng: np.random.Generator) -> Array:
    """Return what the sensor measures of distances `(H, W)` [m]: NaN where it measures nothing.

    Neighbours err alike, for stereo matches windows and not pixels. Beside an edge one of its two cameras
    sees what the other does not, so there it often has nothing to match.
    """
    noise = rng.standard_normal(true.shape)
    if config.grain:
        # Averaging weakens noise; it shall have the deviation that the figures say.
        noise = np.asarray(cv2.GaussianBlur(noise, (0, 0), config.grain), dtype=np.float64)
        noise /= noise.std()
    seen = np.where(np.isfinite(true), true, np.nan)
    measured = seen + noise * (config.floor + config.growth * seen**2)
    if config.step:
        measured = np.round(measured / config.step) * config.step
    lost = rng.random(true.shape) < np.where(_edges(true, config), config.edge_dropout, config.dropout)
    return np.where(lost, np.nan, measured)


def _edges(true: Array, config: DepthConfig) -> NDArray[np.bool_]:
    """Return where `(H, W)` a jump of the distance is near."""
    finite = np.where(np.isfinite(true), true, FAR).astype(np.float32)
    around = np.ones((3, 3), np.uint8)
    jumps = (cv2.dilate(finite, around) - cv2.erode(finite, around) > config.edge).astype(np.uint8)
    width = 2 * config.edge_width + 1
    return cv2.dilate(jumps, np.ones((width, width), np.uint8)).astype(bool)
