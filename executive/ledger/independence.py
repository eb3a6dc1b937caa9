"""Looks that are not independent: from one pose, a detector repeats a share of its errors."""

from __future__ import annotations

from executive.messages import Detections

GRID = 0.02
"""Grid to which camera positions are rounded; equal rounded positions count as one pose [m]."""


def viewpoint_of(look: Detections) -> str:
    """Return a key for detector and camera pose of a look; looks with the same key may repeat errors."""
    x, y, z = (round(float(value) / GRID) for value in look.frame.X_WC.position)
    return f"{look.detector} {x} {y} {z}"


def repeat_probability(independent: float, repeated: float) -> float:
    """Return the probability that a look gives the answer of an earlier look from the same viewpoint again.

    Args:
        independent: Probability of this answer in a look that is independent of the earlier one.
        repeated: Probability that the look is a copy of the earlier one.
    """
    return repeated + (1.0 - repeated) * independent
