"""How long joint moves take at least, in closed form and for many moves at once."""

from __future__ import annotations

import numpy as np

from executive.geometry import Array
from executive.motion.limits import JointLimits


def rest_to_rest(change: Array, limits: JointLimits) -> Array:
    """Return the shortest time `(...)` [s] of a move from rest to rest by `change` `(..., 7)` [rad].

    Every joint has a profile of its own, and the slowest one decides. A jerk-limited profile reaches the
    largest velocity, or only the largest acceleration, or neither, depending on how far the move is.
    """
    far = np.abs(change)
    v, a, j = limits.velocity, limits.acceleration, limits.jerk
    rise = a / j  # [s] from rest to the largest acceleration
    ramp = np.where(v >= a * rise, v / a + rise, 2 * np.sqrt(v / j))  # [s] to the largest velocity
    short = np.where(far >= 2 * a * rise**2, rise + np.sqrt(rise**2 + 4 * far / a), 4 * np.cbrt(far / 2 / j))
    return np.max(np.where(far >= v * ramp, far / v + ramp, short), axis=-1)
