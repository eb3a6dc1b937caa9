"""Acceleration limits due to the load: its seal must hold with a safety factor."""

from __future__ import annotations

import math

import numpy as np

from executive.cell.clock import STEP
from executive.cell.objects import Load
from executive.geometry import GRAVITY, Array
from executive.motion.arm_model import Kinematics
from executive.motion.trajectory import Trajectory
from executive.motion.transcription import SAMPLES_PER_STEP, Demand

SAFETY_FACTOR = 2.0
"""Factor between what a seal bears and what it is asked to bear."""
DISTANCE_PER_ACCELERATION = 0.02
"""What a demand counts for an acceleration of 1 m/s² too much [m]."""
POSITION_STRIDE = 4
"""Distance between the positions of a course that are looked at; a divisor of SAMPLES."""
_WEIGHTS = np.array([1.0, -2.0, 1.0])
_DIFFERENCE = 1e-4  # [rad]
MIN_LIFT_ACCELERATION = 0.5
"""Acceleration with which even a load is lifted whose seal hardly bears its weight [m/s²]."""
MIN_ACCELERATION_SHARE = 0.2
"""Least share of its limits at which the arm still moves: a seal that bears less is carried all the same."""


class PayloadLimit:
    """Acceleration limit of a load: its seal bears its weight and inertia with the safety factor.

    It bears `m |a + g|` at the load's middle.

    Args:
        load: What the tool holds.
        kinematics: The arm's.
    """

    def __init__(self, load: Load, kinematics: Kinematics) -> None:
        self._most = load.bears / SAFETY_FACTOR / load.kind.mass  # [m/s²]
        self._middle = load.kind.height / 2
        self._kinematics = kinematics

    @property
    def lift(self) -> float:
        """The largest acceleration straight up that the seal bears [m/s²]."""
        return max(self._most - GRAVITY, MIN_LIFT_ACCELERATION)

    def share(self, trajectory: Trajectory) -> float:
        """Return the share of its accelerations at which a motion keeps the safety factor, 1 at most."""
        middle = self._middles(trajectory.samples.q)
        if len(middle) < 4:
            return 1.0
        # The last sample is not a whole step after the one before.
        acceleration = np.diff(middle[:-1], n=2, axis=0) / STEP**2
        return float(np.min(_shares(acceleration, self._most)))

    def gentle(self, trajectory: Trajectory) -> Trajectory:
        """Return a motion so slow that it keeps the safety factor, or comes nearest to it."""
        share = self.share(trajectory)
        # Flown at a rate, accelerations are as its square.
        return trajectory if share >= 1 else trajectory.slowed(math.sqrt(max(share, MIN_ACCELERATION_SHARE)))

    def demand(self, qs: Array, time: float, near: float) -> Demand:
        """Return what it demands of positions of a course `(M, n)` [rad], `time` [s] apart from each other.

        Left out is what is farther than `near` from its bounds. A metre stands for 50 m/s².
        """
        # The ends of the steps of the course are among them: there its accelerations turn.
        rows = np.arange(POSITION_STRIDE - 1, len(qs) - 1, POSITION_STRIDE)[:, None] + np.array([-1, 0, 1])
        middles = self._middles(qs)
        felt = _WEIGHTS @ middles[rows] / time**2
        acceleration = felt.copy()
        felt[:, 2] += GRAVITY
        pull = np.linalg.norm(felt, axis=1)
        slack = DISTANCE_PER_ACCELERATION * (self._most - pull)
        chosen = np.nonzero(slack < near)[0]
        rows, direction = rows[chosen], felt[chosen] / pull[chosen, None]
        moved = qs[rows][:, :, None] + _DIFFERENCE * np.eye(qs.shape[1])
        there = self._middles(moved.reshape(-1, qs.shape[1])).reshape(*moved.shape[:3], 3)
        jacobian = (there - middles[rows][:, :, None]) / _DIFFERENCE
        slopes = (
            -DISTANCE_PER_ACCELERATION / time**2 * np.einsum("k,rkjx,rx->rkj", _WEIGHTS, jacobian, direction)
        )
        # The same positions in more time: accelerations fall with its square.
        growth = (
            2
            * DISTANCE_PER_ACCELERATION
            * np.einsum("rx,rx->r", direction, acceleration[chosen])
            / (SAMPLES_PER_STEP * time)
        )
        return Demand(slack[chosen], rows, slopes, growth)

    def _middles(self, qs: Array) -> Array:
        """Return the middle of the load at joint positions `(N, n)` as `(N, 3)` [m]."""
        tips, axes = self._kinematics.tips(qs)
        return np.asarray(tips + self._middle * axes)


def _shares(acceleration: Array, pull: float) -> Array:
    """Return the largest share `k`, 0 to 1, of each acceleration `(N, 3)` with `|k a + g| <= pull` [m/s²]."""
    square = np.sum(acceleration**2, axis=1) + 1e-12
    along = GRAVITY * acceleration[:, 2]
    inside = along**2 - square * (GRAVITY**2 - pull**2)
    shares = (np.sqrt(np.maximum(inside, 0.0)) - along) / square
    return np.clip(np.where(inside < 0, 0.0, shares), 0.0, 1.0)
