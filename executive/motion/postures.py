"""The postures in which the arm can make a whole stroke: one branch and one elbow swivel throughout."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from executive.errors import Unreachable
from executive.geometry import Array
from executive.motion.kinematics import Kinematics, wrapped
from executive.motion.strokes import Stroke

LIMIT_MARGIN = math.radians(1.0)
"""Distance that chosen joint positions keep from the limits where they can [rad]."""
COARSE, FINE = 5.0, 0.25
"""Angle between the swivels tried first, and where that finds no posture [degree]."""


@dataclass(frozen=True, eq=False)
class Postures:
    """Joint chains for a stroke of `G` vias.

    With the tool pointing straight down its yaw is joint 7's alone, so a free yaw leaves joint 7 free.

    Attributes:
        chains: Joint positions `(N, G, 7)` [rad]; joint 7 relative to the first via.
        lowest, highest: Range of joint 7 at the first via `(N,)` [rad]; equal where the yaw is given.
    """

    chains: Array
    lowest: Array
    highest: Array

    def after(self, wrist: Array) -> Array:
        """Return the chains `(P, N, G, 7)` after joint 7 was at each `wrist` `(P,)`, turning it least."""
        first = np.clip(wrist[:, None], self.lowest, self.highest)
        chains = np.broadcast_to(self.chains, (len(wrist), *self.chains.shape)).copy()
        chains[..., 6] += first[..., None]
        return chains


def find_postures(kinematics: Kinematics, stroke: Stroke, q_start: Array) -> Postures:
    """Return every posture for the stroke inside the joint limits; at least one.

    A stroke that continues where the arm is keeps the posture of `q_start` `(7,)` [rad] if it can.

    Raises:
        Unreachable: There is none; the text says at which via and why.
    """
    swivel = kinematics.swivel(q_start)
    for spacing, margin in ((COARSE, LIMIT_MARGIN), (FINE, 0.0)):
        swivels = swivel + np.radians(np.arange(0.0, 360.0, spacing))
        grids = [kinematics.grid(pose, swivels).reshape(-1, 7) for pose in stroke.poses]
        limit = kinematics.position_limit - margin
        postures, inside = _postures(grids, stroke, limit, q_start if stroke.continues else None, kinematics)
        own = kinematics.branch(q_start) * len(swivels)
        if stroke.continues and inside[own]:
            inside = np.arange(len(inside)) == own
        if inside.any():
            return Postures(postures.chains[inside], postures.lowest[inside], postures.highest[inside])
    raise _why_not(kinematics, stroke, grids)


def _postures(
    grids: list[Array], stroke: Stroke, limit: Array, q_start: Array | None, kinematics: Kinematics
) -> tuple[Postures, Array]:
    """Return all postures and which of them `(N,)` are inside `limit` at every via."""
    chains = np.stack(grids, axis=1)
    natural = chains[:, 0, 6].copy()  # joint 7 at the first via and yaw 0
    drift = wrapped(chains[..., 6] - natural[:, None])
    chains[..., 6] = drift
    lowest, highest = -limit[6] - drift.min(axis=1), limit[6] - drift.max(axis=1)
    inside = np.all(np.abs(chains[..., :6]) <= limit[:6], axis=(1, 2)) & (lowest <= highest)
    yaw = stroke.yaw
    if yaw is None and q_start is not None:  # keep the yaw the tool has
        R_WT = kinematics.forward(q_start).rotation
        yaw = math.atan2(-R_WT[0, 1], R_WT[1, 1])
    if yaw is not None:
        turned = wrapped(natural - yaw)
        inside &= (lowest <= turned) & (turned <= highest)
        lowest = highest = turned
    return Postures(chains, lowest, highest), inside


def _why_not(kinematics: Kinematics, stroke: Stroke, grids: list[Array]) -> Unreachable:
    """Return the error about the first via that cannot be reached, or about the stroke as a whole."""
    limit = kinematics.position_limit
    for pose, grid in zip(stroke.poses, grids, strict=True):
        there = grid.copy()
        there[:, 6] = 0.0 if stroke.yaw is None else wrapped(grid[:, 6] - stroke.yaw)
        if not np.any(np.all(np.abs(there) <= limit, axis=1)):
            return kinematics.outside_limits(pose, there)
    x, y, _ = stroke.poses[0].position
    heights = ", ".join(f"{pose.position[2]:.3f}" for pose in stroke.poses)
    return Unreachable(
        f"the tool can reach each of the heights {heights} m above ({x:.3f}, {y:.3f}) m, but no single "
        f"posture of the arm reaches all: split the move"
    )
