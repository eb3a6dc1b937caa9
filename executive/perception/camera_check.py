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

Measured with cameras at their declared poses: at most 0.6 mm (wrist camera) and 2.1 mm (fixed camera) in 264
frames of eight cells with different light, shadows, tables and fill levels of the bins; at most 0.5 mm (wrist
camera) and 2.2 mm (fixed camera) in the 639 frames of 81 complete runs.
"""
MIN_SUPPORT = 0.65
"""Minimum support of an accepted pose: the fraction of the outlines at which the image has an edge."""
MIN_CERTAIN_SUPPORT = 0.85
"""Minimum support at which a pose near the declared pose is accepted without a search for other poses.

In 250 frames of cameras at their declared poses, the support was at least 0.89. In frames of cameras
displaced by 12 to 60 mm, edges of other objects gave poses near the declared pose a support of up to 0.81.
"""
MIN_SUPPORT_GAIN = 0.15
"""Minimum difference between the support of an accepted pose and the support of the declared pose."""


@dataclass(frozen=True, eq=False)
class CameraOffset:
    """Estimated displacement of a camera from its declared pose.

    Attributes:
        shift, shift_std: Translation in the world `(3,)` [m], and the standard deviation along each axis [m].
        rotation_deg: Angle of the rotation from the declared to the estimated pose [degree].
        outline_distance: Mean distance between the outlines of the bins and their expected positions [m].
        pixel_distance: Mean distance between the outlines and their expected positions in the image [pixel].
        support: Fraction of the outlines (0 to 1) at which the image has an edge, for the estimated pose.
        bins: Names of the bins in view.
    """

    shift: Array
    shift_std: Array
    rotation_deg: float
    outline_distance: float
    pixel_distance: float
    support: float
    bins: tuple[str, ...]


def describe_displacement(frame: Frame, bins: Sequence[Bin]) -> str:
    """Return a message about the displacement of a camera, or "" if the frame shows no displacement."""
    offset = estimate_offset(frame, bins)
    if offset is None or offset.outline_distance <= MAX_OUTLINE_DISTANCE:
        return ""
    x, y, z = 1e3 * offset.shift
    return (
        f"camera {frame.camera} is not at its declared pose: the outlines of {', '.join(offset.bins)} "
        f"appear {offset.pixel_distance:.0f} pixels ({1e3 * offset.outline_distance:.0f} mm) away from their "
        f"expected positions, as if the camera had moved by ({x:+.0f}, {y:+.0f}, {z:+.0f}) mm (standard "
        f"deviation {1e3 * offset.shift_std.max():.0f} mm) and turned by {offset.rotation_deg:.1f} degrees; "
        f"limit {1e3 * MAX_OUTLINE_DISTANCE:.0f} mm; mount camera and bins as declared, or "
        "measure the pose again"
    )


def estimate_offset(frame: Frame, bins: Sequence[Bin]) -> CameraOffset | None:
    """Return the offset of a camera from its declared pose; None if the image does not determine it."""
    fitter = OutlineFitter(frame, bins)
    near_fit = fitter.refine(np.zeros(6))
    if near_fit is not None and near_fit.support >= MIN_CERTAIN_SUPPORT:
        offset = _make_camera_offset(near_fit, frame, bins)
        if offset.outline_distance <= MAX_OUTLINE_DISTANCE:
            return offset
    # The edges near the expected outlines may belong to other objects, so that other poses are tried too.
    fits = [fit for fit in (near_fit, *fitter.search()) if fit is not None]
    best_fit = max(fits, key=lambda fit: fit.support, default=None)
    min_support = max(MIN_SUPPORT, fitter.compute_support(np.zeros(6)) + MIN_SUPPORT_GAIN)
    if best_fit is None or best_fit.support < min_support:
        return None
    return _make_camera_offset(best_fit, frame, bins)


def _make_camera_offset(fit: PoseFit, frame: Frame, bins: Sequence[Bin]) -> CameraOffset:
    """Return the camera offset that corresponds to a fitted pose."""
    samples, R_WC = fit.samples, frame.X_WC.rotation
    expected_pixels = project(frame.matrix, frame.X_WC, samples.world_points)
    distances = np.linalg.norm(samples.pixels - expected_pixels, axis=1)
    return CameraOffset(
        shift=R_WC @ fit.offset[3:],
        shift_std=np.sqrt(np.diag(R_WC @ fit.covariance[3:, 3:] @ R_WC.T)),
        rotation_deg=math.degrees(float(np.linalg.norm(fit.offset[:3]))),
        outline_distance=float((distances * samples.camera_points[:, 2]).mean() / frame.matrix[0, 0]),
        pixel_distance=float(distances.mean()),
        support=fit.support,
        bins=tuple(bins[index].name for index in np.unique(samples.bin_indices)),
    )
