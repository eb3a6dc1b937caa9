"""State, range and limits of the joints of an arm, and the minimum time of a motion within the limits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import LimitsConfig
from executive.geometry import Array


class JointState(NamedTuple):
    """Position [rad], velocity [rad/s] and acceleration [rad/s²] of `n` joints, each `(n,)` or `(N, n)`."""

    q: Array
    qd: Array
    qdd: Array

    @staticmethod
    def at_rest(q: Array) -> JointState:
        """Return the state of rest at `q` `(n,)` [rad]."""
        return JointState(q, np.zeros(len(q)), np.zeros(len(q)))


class JointRange(NamedTuple):
    """Range of the joint positions: smallest and largest positions, `(n,)` each [rad]."""

    lower: Array
    upper: Array

    def shrink(self, margin: float) -> JointRange:
        """Return the range reduced by `margin` [rad] at both ends of every joint."""
        return JointRange(self.lower + margin, self.upper - margin)

    def contains(self, qs: Array) -> NDArray[np.bool_]:
        """Return a mask `(...)` of the joint positions `(..., n)` [rad] within the range."""
        return np.asarray(np.all((self.lower <= qs) & (qs <= self.upper), axis=-1))

    def compute_excess(self, qs: Array) -> Array:
        """Return the distance of each joint position `(..., n)` from the range [rad]; negative inside."""
        return np.asarray(np.maximum(qs - self.upper, self.lower - qs))

    def describe(self, joint: int) -> str:
        """Return the range of the joint with the index `joint` as text: `±170°` or `-30° to 120°`."""
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
    def from_config(config: LimitsConfig) -> JointLimits:
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


def compute_min_time(displacement: Array, limits: JointLimits) -> Array:
    """Return the minimum time `(...)` [s] of a motion from rest to rest by `displacement` `(..., n)` [rad].

    Each joint has the symmetric seven-phase profile of limited jerk, and the slowest joint determines the
    time. A long profile reaches the maximum velocity `v`; a medium profile reaches only the maximum
    acceleration `a`; a short profile reaches only the maximum jerk `j`.
    """
    d, v, a, j = np.abs(displacement), limits.velocity, limits.acceleration, limits.jerk
    jerk_time = a / j  # [s] from zero to the maximum acceleration
    ramp_time = np.where(v >= a * jerk_time, v / a + jerk_time, 2 * np.sqrt(v / j))  # [s] to maximum velocity
    medium_time = jerk_time + np.sqrt(jerk_time**2 + 4 * d / a)
    short_time = 4 * np.cbrt(d / 2 / j)
    time_below_max_velocity = np.where(d >= 2 * a * jerk_time**2, medium_time, short_time)
    return np.max(np.where(d >= v * ramp_time, d / v + ramp_time, time_below_max_velocity), axis=-1)
