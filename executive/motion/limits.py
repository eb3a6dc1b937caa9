"""Joint limits as arrays in SI units, and the minimum time of a motion within them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import LimitsConfig
from executive.geometry import Array


class JointRange(NamedTuple):
    """Range of the joint positions.

    Attributes:
        lower: Smallest joint positions `(n,)` [rad].
        upper: Largest joint positions `(n,)` [rad].
    """

    lower: Array
    upper: Array

    def shrink(self, margin: float) -> JointRange:
        """Return the range without a margin [rad] at both ends of every joint."""
        return JointRange(self.lower + margin, self.upper - margin)

    def contains(self, qs: Array) -> NDArray[np.bool_]:
        """Return `(...)` bool: True for joint positions `(..., n)` [rad] within the range."""
        return np.asarray(np.all((self.lower <= qs) & (qs <= self.upper), axis=-1))

    def excess(self, qs: Array) -> Array:
        """Return the distance of each joint of `qs` `(..., n)` from the range [rad]; negative inside."""
        return np.asarray(np.maximum(qs - self.upper, self.lower - qs))

    def describe(self, joint: int) -> str:
        """Return the range of a joint, by its index, in words."""
        lower, upper = math.degrees(self.lower[joint]), math.degrees(self.upper[joint])
        return f"±{upper:.0f}°" if lower == -upper else f"{lower:.0f}° to {upper:.0f}°"


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Limits of `n` joints, each an array `(n,)`.

    Attributes:
        position: Range of the joint positions.
        velocity: Maximum velocity [rad/s].
        acceleration: Maximum acceleration [rad/s²].
        jerk: Maximum jerk [rad/s³].
        stop_acceleration: Maximum acceleration during braking [rad/s²].
        stop_jerk: Maximum jerk during braking [rad/s³].
    """

    position: JointRange
    velocity: Array
    acceleration: Array
    jerk: Array
    stop_acceleration: Array
    stop_jerk: Array

    @staticmethod
    def of(config: LimitsConfig) -> JointLimits:
        """Return the limits of a cell file."""
        lower, upper = np.radians(config.position_ranges_deg).T
        return JointLimits(
            position=JointRange(lower, upper),
            velocity=np.radians(config.velocity_deg),
            acceleration=np.array(config.acceleration),
            jerk=np.array(config.jerk),
            stop_acceleration=np.array(config.stop_acceleration),
            stop_jerk=np.array(config.stop_jerk),
        )

    @property
    def joint_count(self) -> int:
        """Number of joints, `n`."""
        return len(self.velocity)


def min_time(change: Array, limits: JointLimits) -> Array:
    """Return the minimum time `(...)` [s] of a motion from rest to rest by `change` `(..., n)` [rad].

    Each joint has its own jerk-limited profile, and the slowest joint determines the time. Depending on the
    distance, a profile reaches the maximum velocity, or only the maximum acceleration, or neither.
    """
    d, v, a, j = np.abs(change), limits.velocity, limits.acceleration, limits.jerk
    rise = a / j  # [s] from rest to the maximum acceleration
    ramp = np.where(v >= a * rise, v / a + rise, 2 * np.sqrt(v / j))  # [s] to the maximum velocity
    short = np.where(d >= 2 * a * rise**2, rise + np.sqrt(rise**2 + 4 * d / a), 4 * np.cbrt(d / 2 / j))
    return np.max(np.where(d >= v * ramp, d / v + ramp, short), axis=-1)
