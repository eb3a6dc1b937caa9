"""Trajectory optimization: the fastest motion between two states that avoids all obstacles.

Sequential quadratic programming: each step linearizes the distances of the current course from the obstacles,
and solves for the shortest course nearby. The first course approximates a slow motion without collision that
stops at corners above the obstacles. This motion determines on which side a course passes each obstacle.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from executive.geometry import Array
from executive.motion.arm_model import Kinematics
from executive.motion.clearance_model import ClearanceModel, Discs
from executive.motion.limits import JointLimits
from executive.motion.payload import PayloadLimit
from executive.motion.point_to_point import Connector, NoProfile, PointToPoint
from executive.motion.state import JointState
from executive.motion.transcription import (
    SAMPLES_PER_STEP,
    STEP_COUNT,
    VIOLATION_COST,
    Demand,
    JointCourse,
    Transcription,
)

MAX_DISTANCE = 0.03
"""Largest slack of the positions and demands in a quadratic program [m]."""
FIRST_TRUST, TRUST_DECAY = 0.3, 0.9
"""Largest change of accelerations in the first step, as a share of their limits, and its factor per step."""
FIRST_DURATION_SHARE = 0.8
"""Duration of the first course as a share of the duration of the motion that stops at corners."""
LIMIT_MARGIN = 0.01
"""Distance from the position limits of the joints [rad]."""
_JOINT_DIFFERENCE = 1e-4  # [rad]


@dataclass(frozen=True, eq=False)
class Problem:
    """The optimization problem between two states.

    Attributes:
        start, end: The states.
        connector: Connects states within the joint limits.
        kinematics: Kinematics of the arm.
        clearance: Distances from the obstacles.
        discs: Tool and load.
        payload: Acceleration limit due to the load, or None.
    """

    start: JointState
    end: JointState
    connector: Connector
    kinematics: Kinematics
    clearance: ClearanceModel
    discs: Discs
    payload: PayloadLimit | None = None

    def slack(self, qs: Array) -> Array:
        """Return the smallest distance [m] or joint angle [rad] beyond the required one `(N,)`.

        `qs` are joint positions `(N, n)` [rad]. The smaller of both numbers counts.
        """
        tips, axes = self.kinematics.tips(qs)
        return np.minimum(self.clearance.slack(tips, axes, self.discs), self._range_slack(qs).min(axis=1))

    def slopes(self, qs: Array, slack: Array) -> Array:
        """Return the derivative `(N, n)` [m/rad] of the slack `(N,)` at joint positions `(N, n)` [rad]."""
        tips, axes = self.kinematics.tips(qs)
        count = qs.shape[1]
        moved_qs = (qs[:, None] + _JOINT_DIFFERENCE * np.eye(count)).reshape(-1, count)
        moved_tips, moved_axes = (values.reshape(-1, count, 3) for values in self.kinematics.tips(moved_qs))
        changes = self.clearance.slopes(tips, axes, self.discs, (moved_tips, moved_axes))
        slopes = changes / _JOINT_DIFFERENCE
        range_slack = self._range_slack(qs)
        row, joint = np.arange(len(qs)), np.argmin(range_slack, axis=1)
        limited = range_slack[row, joint] <= slack
        row, joint = row[limited], joint[limited]
        middle = (self.kinematics.joint_range.lower + self.kinematics.joint_range.upper) / 2
        slopes[row] = 0.0
        slopes[row, joint] = -np.sign((qs - middle)[row, joint])
        return slopes

    def _range_slack(self, qs: Array) -> Array:
        return -self.kinematics.joint_range.shrink(LIMIT_MARGIN).excess(qs)


class Optimizer:
    """Searches for the fastest motion between two states, a few steps at a time.

    Args:
        problem: The optimization problem.
        first: Joint positions `(M, n)` [rad] of a motion between the states, at the places of a course.
        duration: Duration of this motion [s].

    Attributes:
        cost: Duration of the best course, and the cost of its violated distances [s].

    Raises:
        NoProfile: No course approximates the first motion.
    """

    def __init__(self, problem: Problem, first: Array, duration: float) -> None:
        self._problem = problem
        self._transcription = Transcription(problem.start, problem.end, problem.connector.limits)
        course = self._transcription.fit(FIRST_DURATION_SHARE * duration / STEP_COUNT, first)
        if course is None:
            raise NoProfile("no course approximates the motion that stops at corners")
        self._best, self.cost, self._trust = course, np.inf, FIRST_TRUST
        self._payload_demands: list[Demand] = []
        self._evaluate(course)

    def improve(self, steps: int) -> None:
        """Take up to `steps` steps."""
        for _ in range(steps):
            rows = np.nonzero(self._slack < MAX_DISTANCE)[0]
            slack = self._slack[rows]
            slopes = self._problem.slopes(self._last.qs[rows], slack)
            distances = Demand(slack, rows[:, None], slopes[:, None], np.zeros(len(rows)))
            demands = [distances, *self._payload_demands]
            course = self._transcription.shorten(self._last, demands, self._trust)
            if course is None:
                return
            self._trust *= TRUST_DECAY
            self._evaluate(course)

    def _evaluate(self, course: JointCourse) -> None:
        """Make `course` the last course, and the best course if its cost is lowest."""
        self._last, self._slack = course, self._problem.slack(course.qs)
        violations = [-float(self._slack.min())]
        if self._problem.payload is not None:
            time = course.step / SAMPLES_PER_STEP
            demand = self._problem.payload.demand(course.qs, time, MAX_DISTANCE)
            violations.append(-float(demand.slack.min(initial=MAX_DISTANCE)))
            self._payload_demands = [demand]
        cost = course.duration + VIOLATION_COST * max(0.0, *violations)
        if cost < self.cost:
            self._best, self.cost = course, cost

    def connect_states(self, exactly: bool) -> tuple[PointToPoint, ...]:
        """Return the best course as motions between its states.

        Args:
            exactly: True to connect the states of all half steps within the times of the course; False to
                connect the states of all steps as fast as possible, on a slightly different path.

        Raises:
            NoProfile: No motion connects two of the states.
        """
        min_duration = self._best.step / 2 if exactly else None
        states = [
            _limit_velocity(state, self._problem.connector.limits)
            for state in self._transcription.states(self._best)[:: 1 if exactly else 2]
        ]
        return tuple(self._problem.connector.connect(a, b, min_duration) for a, b in pairwise(states))


def _limit_velocity(state: JointState, limits: JointLimits) -> JointState:
    """Return the nearest state through which a motion can pass without exceeding a velocity limit.

    An acceleration `a` changes the velocity by `a² / 2 j` until it has fallen to 0.
    """
    max_velocity = limits.velocity - state.qdd**2 / (2 * limits.jerk)
    return state._replace(qd=np.clip(state.qd, -max_velocity, max_velocity))
