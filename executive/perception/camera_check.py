"""Check of a camera's declared pose against the outlines of the bins in a frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from executive.cell.bins import Bin
from executive.cell.frame import Frame
from executive.geometry import Array
from executive.perception.camera_model import project
from executive.perception.outline_fit import Fit, OutlineFitter

MAX_DISTANCE = 0.005
"""Largest accepted mean distance between the outlines of the bins and their expected positions [m].

Measured in 264 frames of undisplaced cameras (eight cells; lamps, shadows and tables varied; bins full and
empty): wrist camera at most 0.6 mm, fixed camera at most 2.1 mm. With earlier settings of the fit, 990 frames
had at most 3.6 mm, except one whose table had the colour of a bin; it now gives no estimate. In all 639
frames of 81 complete runs, the arm in view and the bins filling: wrist camera at most 0.5 mm, fixed camera at
most 2.2 mm.
"""
MIN_SUPPORT = 0.65
"""Smallest share of the outlines with an edge beside them at which an estimated pose is accepted."""
MIN_CLEAR_SUPPORT = 0.85
"""Smallest support at which a pose near the declared one is accepted without a search for other poses.

In 250 frames of undisplaced cameras in the light of the cells it was at least 0.89. In frames of cameras
moved by 12 to 60 mm, poses near the declared one had a support of up to 0.81 from other edges.
"""
MIN_GAIN = 0.15
"""Smallest difference between the support of a displaced pose and that of the declared pose."""


@dataclass(frozen=True, eq=False)
class CameraOffset:
    """Estimated displacement of a camera from its declared pose.

    Attributes:
        shift, shift_std: Displacement in the world `(3,)` [m], and its standard deviation.
        rotation_deg: Angle of the rotation [degree].
        distance: Mean distance between the outlines of the bins and their expected positions [m].
        distance_px: Mean distance between the outlines and their expected positions in the image [pixel].
        support: Share of the outlines (0 to 1) with an edge beside them, at the estimated pose.
        bins: Names of the bins in view.
    """

    shift: Array
    shift_std: Array
    rotation_deg: float
    distance: float
    distance_px: float
    support: float
    bins: tuple[str, ...]


def describe_displacement(frame: Frame, bins: Sequence[Bin]) -> str:
    """Return in words how a camera is displaced; "" if it is not, or if the frame cannot show it."""
    offset = estimate_offset(frame, bins)
    if offset is None or offset.distance <= MAX_DISTANCE:
        return ""
    x, y, z = 1e3 * offset.shift
    return (
        f"camera {frame.camera} is not where the cell file says: the outlines of {', '.join(offset.bins)} "
        f"appear {offset.distance_px:.0f} pixels ({1e3 * offset.distance:.0f} mm) away from their expected "
        f"positions, as if the camera had moved by ({x:+.0f}, {y:+.0f}, {z:+.0f}) mm (standard deviation "
        f"{1e3 * offset.shift_std.max():.0f} mm) and turned by {offset.rotation_deg:.1f} degrees; limit "
        f"{1e3 * MAX_DISTANCE:.0f} mm; mount camera and bins as declared, or measure the pose again"
    )


def estimate_offset(frame: Frame, bins: Sequence[Bin]) -> CameraOffset | None:
    """Return how far a camera is from the pose of its frame; None if the frame shows too little."""
    fitting = OutlineFitter(frame, bins)
    near = fitting.refine(np.zeros(6))
    if near is not None and near.support >= MIN_CLEAR_SUPPORT:
        offset = _convert_fit(near, frame, bins)
        if offset.distance <= MAX_DISTANCE:
            return offset
    # The nearest edges may belong to other things: search for the pose that explains most of the outlines.
    fits = [fit for fit in (near, *fitting.search()) if fit is not None]
    best = max(fits, key=lambda fit: fit.support, default=None)
    min_support = max(MIN_SUPPORT, fitting.support(np.zeros(6)) + MIN_GAIN)
    return None if best is None or best.support < min_support else _convert_fit(best, frame, bins)


def _convert_fit(fit: Fit, frame: Frame, bins: Sequence[Bin]) -> CameraOffset:
    """Return a fit as an offset in the world."""
    samples, R_WC = fit.samples, frame.X_WC.rotation
    declared = project(frame.matrix, frame.X_WC, samples.points)
    pixels = np.linalg.norm(samples.pixels - declared, axis=1)
    return CameraOffset(
        shift=R_WC @ fit.offset[3:],
        shift_std=np.sqrt(np.diag(R_WC @ fit.covariance[3:, 3:] @ R_WC.T)),
        rotation_deg=math.degrees(float(np.linalg.norm(fit.offset[:3]))),
        distance=float((pixels * samples.in_camera[:, 2]).mean() / frame.matrix[0, 0]),
        distance_px=float(pixels.mean()),
        support=fit.support,
        bins=tuple(bins[index].name for index in np.unique(samples.bins)),
    )
