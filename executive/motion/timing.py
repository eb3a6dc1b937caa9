"""How long a straight joint move takes, in closed form and for many moves at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from executive.geometry import Array
from executive.motion.limits import JointLimits


class PathLimits(NamedTuple):
    """Limits of the path parameter, 0 to 1, along a straight joint move, each of shape `(...)`.

    Given as inverses, so that a joint that stands still gives 0 and not infinity.
    """

    slowness: Array
    """1 / largest rate [s]."""
    sluggishness: Array
    """1 / largest acceleration [s²]."""
    softness: Array
    """1 / largest jerk [s³]."""


def path_limits(change: Array, limits: JointLimits, rate: ArrayLike = np.inf) -> PathLimits:
    """Return the limits of the path parameter that keep every joint inside its own.

    Args:
        change: Joint differences `(..., 7)` [rad].
        limits: The joints' limits.
        rate: Largest rate of the path parameter besides, `(...)` [1/s].
    """
    far = np.abs(change)
    return PathLimits(
        np.maximum(np.max(far / limits.velocity, axis=-1), 1 / np.asarray(rate, dtype=float)),
        np.max(far / limits.acceleration, axis=-1),
        np.max(far / limits.jerk, axis=-1),
    )


def rest_to_rest(change: Array, limits: JointLimits, rate: ArrayLike = np.inf) -> Array:
    """Return the shortest time `(...)` [s] of a straight joint move from rest to rest.

    The jerk-limited profile reaches the largest rate, or only the largest acceleration, or neither,
    depending on how far the move is.
    """
    v, a, j = path_limits(change, limits, rate)
    moves = j > 0
    v, a, j = np.where(moves, v, 1.0), np.where(moves, a, 1.0), np.where(moves, j, 1.0)
    to_acceleration = j / a  # [s] from rest to the largest acceleration
    ramp = np.where(a / v >= to_acceleration, a / v + to_acceleration, 2 * np.sqrt(j / v))  # to the rate
    accelerating = to_acceleration + np.sqrt(to_acceleration**2 + 4 * a)
    short = np.where(2 * to_acceleration**2 <= a, accelerating, 4 * np.cbrt(j / 2))
    return np.where(moves, np.where(ramp <= v, v + ramp, short), 0.0)
