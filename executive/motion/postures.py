"""Joint positions in which the tool points straight down, at a place and along a vertical line."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from executive.cell.arm import Goal
from executive.errors import Unreachable
from executive.geometry import Array, Pose, tool_down
from executive.motion.arm_model import Configuration, Kinematics, Solutions, wrap_angles

LIMIT_MARGIN = math.radians(1.0)
"""Preferred minimum distance of joint positions from their limits [rad]."""
COARSE_SPACING, FINE_SPACING = math.radians(5.0), math.radians(0.25)
"""Distance between redundancy angles in the first search, and in a second one if it finds nothing [rad]."""
MIN_COSINE_DOWN = 0.9998
"""Minimum cosine between the tool axis and straight down at which the tool counts as pointing down."""


@dataclass(frozen=True, eq=False)
class Postures:
    """Pairs of joint positions above a place and at the place, in the same configuration, `N` pairs.

    Attributes:
        high: Joint positions at the upper end of the vertical line `(N, n)` [rad].
        low: Joint positions at the lower end `(N, n)` [rad].
        configurations: Configuration of each pair.
    """

    high: Array
    low: Array
    configurations: tuple[Configuration, ...]

    def __len__(self) -> int:
        return len(self.low)


def find_postures(kinematics: Kinematics, goal: Goal, length: float, q_start: Array) -> Postures:
    """Return all postures within the joint range for a goal and the point `length` [m] above the goal.

    If the yaw of the goal is free, the last joint turns as little as possible from `q_start` `(n,)` [rad].

    Raises:
        Unreachable: There is no posture; the text states the height and the cause.
    """
    x, y, z = goal.position
    poses = [tool_down((x, y, z + length)), tool_down((x, y, z))]
    for spacing, margin in ((COARSE_SPACING, LIMIT_MARGIN), (FINE_SPACING, 0.0)):
        upper, lower = (kinematics.solve_all(pose, q_start, spacing) for pose in poses)
        high, low = upper.qs, lower.qs
        allowed = kinematics.joint_range.shrink(margin)
        _turn_last_joint(high, low, (allowed.lower[-1], allowed.upper[-1]), goal.yaw, float(q_start[-1]))
        inside = allowed.contains(high) & allowed.contains(low)
        if inside.any():
            keys = tuple(lower.configurations[number] for number in np.flatnonzero(inside))
            return Postures(high[inside], low[inside], keys)
    raise _explain_unreachable(kinematics, poses, (upper, lower))


def find_vertical_line(kinematics: Kinematics, q: Array, length: float, samples: int) -> Array | None:
    """Return joint positions `(samples, n)` [rad] on the vertical line from the tool at `q` `(n,)` upwards.

    The line is `length` [m] long, and the configuration is that of `q`. The result is None if the tool does
    not point down, or if a joint would leave its range.
    """
    X_WT = kinematics.forward(q)
    if -X_WT.rotation[2, 2] < MIN_COSINE_DOWN:
        return None
    try:
        chain = _solve_line(kinematics, X_WT, length, samples, kinematics.configuration(q))
    except Unreachable:
        return None
    inside = kinematics.joint_range.contains(chain).all()
    return chain if inside and np.max(np.abs(chain[0] - q)) < 1e-6 else None


def solve_vertical_line(
    kinematics: Kinematics, q: Array, length: float, samples: int, configuration: Configuration
) -> Array:
    """Return joint positions `(samples, n)` [rad] on the vertical line from the tool at `q` `(n,)` upwards.

    Unlike `find_vertical_line`, the function checks neither the tool axis nor the joint range.

    Raises:
        Unreachable: A point of the line is too far from the arm or too near to the arm.
    """
    chain = _solve_line(kinematics, kinematics.forward(q), length, samples, configuration)
    return chain + wrap_angles(q - chain[0])


def _solve_line(
    kinematics: Kinematics, X_WT: Pose, length: float, samples: int, configuration: Configuration
) -> Array:
    chain = np.array(
        [
            kinematics.solve(Pose(X_WT.rotation, X_WT.position + np.array([0.0, 0.0, height])), configuration)
            for height in np.linspace(0.0, length, samples)
        ]
    )
    chain[1:] = chain[0] + wrap_angles(chain[1:] - chain[0])
    return chain


def _turn_last_joint(
    high: Array, low: Array, allowed: tuple[float, float], yaw: float | None, start: float
) -> None:
    """Turn the last joint of postures `(N, n)` from yaw 0 to `yaw`, or to the angle nearest to `start`."""
    drift = wrap_angles(high[:, -1] - low[:, -1])
    if yaw is not None:
        low[:, -1] = wrap_angles(low[:, -1] - yaw)
    else:
        smallest, largest = allowed
        low[:, -1] = np.clip(start, smallest - np.minimum(drift, 0.0), largest - np.maximum(drift, 0.0))
    high[:, -1] = low[:, -1] + drift


def _explain_unreachable(
    kinematics: Kinematics, poses: list[Pose], rejected: tuple[Solutions, Solutions]
) -> Unreachable:
    """Return the error for the first pose without a solution, or for both poses together."""
    for pose, solutions in zip(poses, rejected, strict=True):
        if not np.any(kinematics.joint_range.contains(solutions.qs)):
            return _explain_limits(kinematics, pose, solutions.qs)
    (x, y, top), bottom = poses[0].position, poses[1].position[2]
    return Unreachable(
        f"the tool can reach the heights {top:.3f} and {bottom:.3f} m above ({x:.3f}, {y:.3f}) m, but no "
        f"single posture of the arm reaches both"
    )


def _explain_limits(kinematics: Kinematics, X_WT: Pose, rejected: Array) -> Unreachable:
    """Return the error for a pose whose solutions `(N, n)` all exceed a joint limit."""
    excess = kinematics.joint_range.excess(rejected)
    best = excess[np.nanargmin(np.max(excess, axis=1))]
    joint = int(np.argmax(best))
    x, y, z = X_WT.position
    return Unreachable(
        f"the tool cannot reach ({x:.3f}, {y:.3f}, {z:.3f}) m: no configuration of the arm keeps every joint "
        f"inside its limits; the best one leaves joint {joint + 1} {math.degrees(best[joint]):.1f}° outside "
        f"{kinematics.joint_range.describe(joint)}"
    )
