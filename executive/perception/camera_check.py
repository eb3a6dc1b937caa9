"""Check of the declared pose of a camera against the outlines of the bins in a frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from executive.cell.bins import Bin
from executive.cell.frame import Frame
from executive.geometry import Array
from executive.perception.camera_model import project
from executive.perception.outline_fit import OutlineFitter, PoseFit

MAX_OUTLINE_DISTANCE = 0.005
"""Maximum mean distance between the outlines of the bins and their expected positions [m].

Measured in 264 frames of undisplaced cameras (eight cells; lamps, shadows and tables varied; bins full and
empty): wrist camera at most 0.6 mm, fixed camera at most 2.1 mm. With earlier settings of the fit, 990 frames
had at most 3.6 mm, except one whose table had the colour of a bin; it now gives no estimate. In all 639
frames of 81 complete runs, the arm in view and the bins filling: wrist camera at most 0.5 mm, fixed camera at
most 2.2 mm.
"""
MIN_SUPPORT = 0.65
"""Minimum support (fraction of the outlines at which the image has an edge) of an accepted pose."""
MIN_CERTAIN_SUPPORT = 0.85
"""Minimum support of a pose near the declared pose that is accepted without a search for other poses.

In 250 frames of undisplaced cameras in the light of the cells, the support was at least 0.89. In frames of
cameras moved by 12 to 60 mm, poses near the declared pose had a support of up to 0.81 from other edges.
"""
MIN_SUPPORT_GAIN = 0.15
"""Minimum difference between the support of an accepted pose and the support of the declared pose."""


@dataclass(frozen=True, eq=False)
class CameraOffset:
    """Estimated displacement of a camera from its declared pose.

    Attributes:
        shift, shift_std: Translation in the world `(3,)` [m], and its standard deviation along each axis [m].
        rotation_deg: Angle of the rotation from the declared to the estimated pose [degree].
        distance: Mean distance between the outlines of the bins and their expected positions [m].
        distance_px: Mean distance between the outlines and their expected positions in the image [pixel].
        support: Fraction of the outlines (0 to 1) at which the image has an edge, for the estimated pose.
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
    """Return a message about the displacement of a camera, or "" if the frame shows no displacement."""
    offset = estimate_offset(frame, bins)
    if offset is None or offset.distance <= MAX_OUTLINE_DISTANCE:
        return ""
    x, y, z = 1e3 * offset.shift
    return (
        f"camera {frame.camera} is not at its declared pose: the outlines of {', '.join(offset.bins)} "
        f"appear {offset.distance_px:.0f} pixels ({1e3 * offset.distance:.0f} mm) away from their expected "
        f"positions, as if the camera had moved by ({x:+.0f}, {y:+.0f}, {z:+.0f}) mm (standard deviation "
        f"{1e3 * offset.shift_std.max():.0f} mm) and turned by {offset.rotation_deg:.1f} degrees; limit "
        f"{1e3 * MAX_OUTLINE_DISTANCE:.0f} mm; mount camera and bins as declared, or measure the pose again"
    )


def estimate_offset(frame: Frame, bins: Sequence[Bin]) -> CameraOffset | None:
    """Return the offset of a camera from the pose in its frame; None if the image does not determine it."""
    fitter = OutlineFitter(frame, bins)
    near_fit = fitter.refine(np.zeros(6))
    if near_fit is not None and near_fit.support >= MIN_CERTAIN_SUPPORT:
        offset = _convert_fit(near_fit, frame, bins)
        if offset.distance <= MAX_OUTLINE_DISTANCE:
            return offset
    # The nearest edges may not be those of the bins: search for the pose with the highest support.
    fits = [fit for fit in (near_fit, *fitter.search()) if fit is not None]
    best = max(fits, key=lambda fit: fit.support, default=None)
    min_support = max(MIN_SUPPORT, fitter.compute_support(np.zeros(6)) + MIN_SUPPORT_GAIN)
    return None if best is None or best.support < min_support else _convert_fit(best, frame, bins)


def _convert_fit(fit: PoseFit, frame: Frame, bins: Sequence[Bin]) -> CameraOffset:
    """Return the camera offset in the world for a fitted pose."""
    samples, R_WC = fit.samples, frame.X_WC.rotation
    expected_pixels = project(frame.matrix, frame.X_WC, samples.points)
    distances = np.linalg.norm(samples.pixels - expected_pixels, axis=1)
    return CameraOffset(
        shift=R_WC @ fit.offset[3:],
        shift_std=np.sqrt(np.diag(R_WC @ fit.covariance[3:, 3:] @ R_WC.T)),
        rotation_deg=math.degrees(float(np.linalg.norm(fit.offset[:3]))),
        distance=float((distances * samples.in_camera[:, 2]).mean() / frame.matrix[0, 0]),
        distance_px=float(distances.mean()),
        support=fit.support,
        bins=tuple(bins[index].name for index in np.unique(samples.bins)),
    )
