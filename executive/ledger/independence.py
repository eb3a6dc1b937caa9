"""Looks that are not independent: from one viewpoint, a detector repeats a share of its errors."""

from __future__ import annotations

from executive.cell.detection import Detections

GRID = 0.02
"""Pitch of the grid to which camera positions are rounded [m]; equal rounded positions are one viewpoint."""


def viewpoint_of(look: Detections) -> str:
    """Return a key for detector and camera position of a look; looks with equal keys may repeat errors."""
    x, y, z = (round(float(value) / GRID) for value in look.frame.X_WC.position)
    return f"{look.detector} {x} {y} {z}"


def repeat_probability(independent_probability: float, copy_probability: float) -> float:
    """Return the probability that a look repeats the answer of an earlier look from the same viewpoint.

    Args:
        independent_probability: Probability of this answer in a look that is independent of the earlier one.
        copy_probability: Probability that the look is a copy of the earlier one.
    """
    return copy_probability + (1.0 - copy_probability) * independent_probability
