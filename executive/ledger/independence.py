"""Looks that are not independent: from one pose, a detector repeats a share of its errors."""

from __future__ import annotations

from executive.messages import Detections

GRID = 0.02
"""Distance within which two positions of the camera count as one pose [m]."""


def viewpoint_of(look: Detections) -> str:
    """Return a name for the detector and the camera pose of a look: looks of one name may repeat errors."""
    x, y, z = (round(float(value) / GRID) for value in look.frame.X_WC.position)
    return f"{look.detector} {x} {y} {z}"


def repeat(share: float, repeated: float) -> float:
    """Return the probability that a look gives an answer again which it gives with a `share` otherwise.

    With the probability `repeated` the look is a copy of the earlier one, else it is independent of it.
    """
    return repeated + (1.0 - repeated) * share
