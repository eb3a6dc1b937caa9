"""Limits of the arm's joints as arrays in SI units, and how long moves within them take at least."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from executive.cell.config import LimitsConfig
from executive.geometry import Array


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Joint limits, each of shape `(7,)`.

    Attributes:
        position: Largest angle to either side [rad].
        velocity: [rad/s].
        acceleration: [rad/s²].
        jerk: [rad/s³].
        stop_acceleration: Largest acceleration while braking [rad/s²].
        stop_jerk: Largest jerk while braking [rad/s³].
    """

    position: Array
    velocity: Array
    acceleration: Array
    jerk: Array
    stop_acceleration: Array
    stop_jerk: Array

    @staticmethod
    def of(config: LimitsConfig) -> JointLimits:
        """Return the limits of a cell file in radians."""
        return JointLimits(
            position=np.radians(config.position_deg),
            velocity=np.radians(config.velocity_deg),
            acceleration=np.array(config.acceleration),
            jerk=np.array(config.jerk),
            stop_acceleration=np.array(config.stop_acceleration),
            stop_jerk=np.array(config.stop_jerk),
        )


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
