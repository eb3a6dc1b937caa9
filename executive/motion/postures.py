"""The postures in which the arm can bring its tool down on a place: branch, elbow swivel, turn of joint 7."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from executive.cell.arm import Goal
from executive.errors import Unreachable
from executive.geometry import Array, Pose, tool_down
from executive.motion.kinematics import Kinematics, wrapped

LIMIT_MARGIN = math.radians(1.0)
"""Distance that chosen joint positions keep from the limits where they can [rad]."""
COARSE, FINE = 5.0, 0.25
"""Angle between the swivels tried first, and where that finds no posture [degree]."""
UPRIGHT = 0.9998
"""Least cosine between the tool's axis and straight down at which it counts as pointing down."""


@dataclass(frozen=True, eq=False)
class Postures:
    """Ways to stand over a place and to come down on it without changing posture, `N` of them.

    With the tool pointing straight down its yaw is joint 7's alone, so a free yaw leaves joint 7 free.

    Attributes:
        high: Joint positions where the way down begins `(N, 7)` [rad].
        low: Joint positions where it ends `(N, 7)` [rad].
        branch: Row of `BRANCHES` of each `(N,)`.
        swivel: Elbow swivel of each `(N,)` [rad].
    """

    high: Array
    low: Array
    branch: Array
    swivel: Array

    def __len__(self) -> int:
        return len(self.low)


def find_postures(kinematics: Kinematics, goal: Goal, length: float, q_start: Array) -> Postures:
    """Return every posture inside the joint limits for a goal and the last `length` [m] above it.

    Joint 7 turns least from where it is at `q_start` `(7,)` [rad], if the yaw is free.

    Raises:
        Unreachable: There is none; the text says at which height and why.
    """
    x, y, z = goal.position
    poses = [tool_down((x, y, z + length)), tool_down((x, y, z))]
    swivel = kinematics.swivel(q_start)
    for spacing, margin in ((COARSE, LIMIT_MARGIN), (FINE, 0.0)):
        swivels = swivel + np.radians(np.arange(0.0, 360.0, spacing))
        high, low = (kinematics.grid(pose, swivels).reshape(-1, 7) for pose in poses)
        limit = kinematics.position_limit - margin
        _turn_wrist(high, low, limit[6], goal.yaw, float(q_start[6]))
        inside = np.all((np.abs(high) <= limit) & (np.abs(low) <= limit), axis=1)
        if inside.any():
            branch, number = np.divmod(np.nonzero(inside)[0], len(swivels))
            return Postures(high[inside], low[inside], branch, swivels[number])
    raise _why_not(kinematics, poses, (high, low))


def upright_line(kinematics: Kinematics, q: Array, length: float, samples: int) -> Array | None:
    """Return joint positions `(samples, 7)` [rad] with the tool at `q` `(7,)` and up to `length` [m] above.

    The posture is that of `q`. None where the tool does not point down, or a joint would leave its range.
    """
    X_WT = kinematics.forward(q)
    if -X_WT.rotation[2, 2] < UPRIGHT:
        return None
    try:
        chain = _chain(kinematics, X_WT, length, samples, kinematics.branch(q), kinematics.swivel(q))
    except Unreachable:
        return None
    inside = np.all(np.abs(chain) <= kinematics.position_limit)
    return chain if inside and np.max(np.abs(chain[0] - q)) < 1e-6 else None


def line_chain(
    kinematics: Kinematics, q: Array, length: float, samples: int, branch: int, swivel: float
) -> Array:
    """Return joint positions `(samples, 7)` [rad] of the posture at `q` `(7,)`, going up from there.

    Raises:
        Unreachable: The tool gets too far or too near on the way.
    """
    chain = _chain(kinematics, kinematics.forward(q), length, samples, branch, swivel)
    return chain + wrapped(q - chain[0])


def _chain(
    kinematics: Kinematics, X_WT: Pose, length: float, samples: int, branch: int, swivel: float
) -> Array:
    chain = np.empty((samples, 7))
    for number, height in enumerate(np.linspace(0.0, length, samples)):
        pose = Pose(X_WT.rotation, X_WT.position + np.array([0.0, 0.0, height]))
        chain[number] = kinematics.grid(pose, np.array([swivel]))[branch, 0]
    chain[1:] = chain[0] + wrapped(chain[1:] - chain[0])
    return chain


def _turn_wrist(high: Array, low: Array, limit: float, yaw: float | None, start: float) -> None:
    """Turn joint 7 of postures `(N, 7)` at yaw 0 to the given yaw, or as little as can be from `start`."""
    drift = wrapped(high[:, 6] - low[:, 6])
    if yaw is not None:
        low[:, 6] = wrapped(low[:, 6] - yaw)
    else:
        low[:, 6] = np.clip(start, -limit - np.minimum(drift, 0.0), limit - np.maximum(drift, 0.0))
    high[:, 6] = low[:, 6] + drift


def _why_not(kinematics: Kinematics, poses: list[Pose], rejected: tuple[Array, Array]) -> Unreachable:
    """Return the error about the height that cannot be reached, or about both together."""
    for pose, found in zip(poses, rejected, strict=True):
        if not np.any(np.all(np.abs(found) <= kinematics.position_limit, axis=1)):
            return kinematics.outside_limits(pose, found)
    (x, y, top), bottom = poses[0].position, poses[1].position[2]
    return Unreachable(
        f"the tool can reach the heights {top:.3f} and {bottom:.3f} m above ({x:.3f}, {y:.3f}) m, but no "
        f"single posture of the arm reaches both"
    )
