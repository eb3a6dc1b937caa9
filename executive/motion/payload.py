"""Acceleration limit due to the load: the seal must hold with a safety factor."""

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
"""Ratio of the force that a seal bears to the largest force on the seal during a motion."""
DISTANCE_PER_ACCELERATION = 0.02
"""Distance in a demand that is equivalent to an acceleration of 1 m/s² [m]."""
POSITION_STRIDE = 4
"""Distance between the positions of a course in a demand; a divisor of `SAMPLES_PER_STEP`."""
_SECOND_DIFFERENCE = np.array([1.0, -2.0, 1.0])
_JOINT_DIFFERENCE = 1e-4  # [rad]
MIN_LIFT_ACCELERATION = 0.5
"""Acceleration for lifting a load if its seal hardly bears the weight [m/s²]."""
MIN_ACCELERATION_SHARE = 0.2
"""Minimum share of the planned accelerations, also for a load whose seal bears less."""


class PayloadLimit:
    """Acceleration limit of a load: its seal bears weight and inertia with the safety factor.

    The force on the seal is `m |a + g|`, with the acceleration `a` of the centre of the load.

    Args:
        load: Object in the tool.
        kinematics: Kinematics of the arm.
    """

    def __init__(self, load: Load, kinematics: Kinematics) -> None:
        self._max_pull = load.holding_force / SAFETY_FACTOR / load.kind.mass  # force per mass [m/s²]
        self._centre_offset = load.kind.height / 2
        self._kinematics = kinematics

    @property
    def lift(self) -> float:
        """Maximum acceleration straight up [m/s²]."""
        return max(self._max_pull - GRAVITY, MIN_LIFT_ACCELERATION)

    def share(self, trajectory: Trajectory) -> float:
        """Return the share of its accelerations at which a motion keeps the safety factor, at most 1."""
        centres = self._load_centres(trajectory.samples.q)
        if len(centres) < 4:
            return 1.0
        # The interval before the last sample is shorter than a control step.
        acceleration = np.diff(centres[:-1], n=2, axis=0) / STEP**2
        return float(np.min(_allowed_shares(acceleration, self._max_pull)))

    def slow_down(self, trajectory: Trajectory) -> Trajectory:
        """Return the motion, slowed down so that it keeps the safety factor if possible."""
        share = self.share(trajectory)
        # Accelerations are proportional to the square of the rate.
        rate = math.sqrt(max(share, MIN_ACCELERATION_SHARE))
        return trajectory if share >= 1 else trajectory.slow_down(rate)

    def demand(self, qs: Array, time: float, max_slack: float) -> Demand:
        """Return the demand of the seal on the positions of a course.

        Args:
            qs: Joint positions `(M, n)` [rad].
            time: Time between two positions [s].
            max_slack: Largest slack in the demand [m]; `DISTANCE_PER_ACCELERATION` converts accelerations.
        """
        # The positions include the ends of the steps of the course, where the acceleration has its extrema.
        rows = np.arange(POSITION_STRIDE - 1, len(qs) - 1, POSITION_STRIDE)[:, None] + np.array([-1, 0, 1])
        centres = self._load_centres(qs)
        acceleration = _SECOND_DIFFERENCE @ centres[rows] / time**2
        pull = acceleration + np.array([0.0, 0.0, GRAVITY])
        strength = np.linalg.norm(pull, axis=1)
        slack = DISTANCE_PER_ACCELERATION * (self._max_pull - strength)
        chosen = np.nonzero(slack < max_slack)[0]
        rows, direction = rows[chosen], pull[chosen] / strength[chosen, None]
        moved = qs[rows][:, :, None] + _JOINT_DIFFERENCE * np.eye(qs.shape[1])
        moved_centres = self._load_centres(moved.reshape(-1, qs.shape[1])).reshape(*moved.shape[:3], 3)
        jacobian = (moved_centres - centres[rows][:, :, None]) / _JOINT_DIFFERENCE
        projected = np.einsum("k,rkjx,rx->rkj", _SECOND_DIFFERENCE, jacobian, direction)
        slopes = -DISTANCE_PER_ACCELERATION / time**2 * projected
        # If the same positions take more time, accelerations fall with the square of the time.
        along = np.einsum("rx,rx->r", direction, acceleration[chosen])
        growth = 2 * DISTANCE_PER_ACCELERATION * along / (SAMPLES_PER_STEP * time)
        return Demand(slack[chosen], rows, slopes, growth)

    def _load_centres(self, qs: Array) -> Array:
        """Return the centre of the load at joint positions `(N, n)` as `(N, 3)` [m]."""
        tips, axes = self._kinematics.tips(qs)
        return np.asarray(tips + self._centre_offset * axes)


def _allowed_shares(acceleration: Array, max_pull: float) -> Array:
    """Return the largest `k`, 0 to 1, with `|k a + g| <= max_pull` [m/s²] for accelerations `a` `(N, 3)`."""
    square = np.sum(acceleration**2, axis=1) + 1e-12
    along = GRAVITY * acceleration[:, 2]
    discriminant = along**2 - square * (GRAVITY**2 - max_pull**2)
    shares = (np.sqrt(np.maximum(discriminant, 0.0)) - along) / square
    return np.clip(np.where(discriminant < 0, 0.0, shares), 0.0, 1.0)
