"""The fastest way from one state to another over what stands between.

Sequential quadratic programming: linearize how near the last course comes to everything, let the program
choose the shortest course near it, and again. The first course follows, as well as it can, a way that
stops at every corner high above everything: so it is settled what is passed above and what beside, and
every step leads from a slow way that is clear to a faster one.
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
"""Distance up to which a state is part of the program [m]."""
FIRST_TRUST, TRUST_DECAY = 0.3, 0.9
"""Share of the limits by which accelerations change in the first step; from step to step it gets less."""
FIRST_DURATION_SHARE = 0.8
"""Share of the time of the way that stops at every corner which the first course takes."""
LIMIT_MARGIN = 0.01
"""Distance from the joints' position limits [rad]."""
_DIFFERENCE = 1e-4  # [rad]


@dataclass(frozen=True, eq=False)
class Problem:
    """The optimization problem between two states.

    Attributes:
        start, end: The states.
        connector: Joins states.
        kinematics: The arm.
        clearance: Distances to all obstacles.
        discs: What hangs under the flange.
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
        """Return by how much joint positions `(N, n)` keep their distance [m] and limits [rad] `(N,)`."""
        tips, axes = self.kinematics.tips(qs)
        return np.minimum(self.clearance.slack(tips, axes, self.discs), self._inside(qs).min(axis=1))

    def slopes(self, qs: Array, slack: Array) -> Array:
        """Return how the slack `(N,)` at joint positions `(N, n)` depends on each joint `(N, n)` [m/rad]."""
        tips, axes = self.kinematics.tips(qs)
        count = qs.shape[1]
        moved = self.kinematics.tips((qs[:, None] + _DIFFERENCE * np.eye(count)).reshape(-1, count))
        shaped = moved[0].reshape(-1, count, 3), moved[1].reshape(-1, count, 3)
        slopes = self.clearance.slopes(tips, axes, self.discs, shaped) / _DIFFERENCE
        inside = self._inside(qs)
        joint = np.argmin(inside, axis=1)
        number = np.arange(len(qs))
        limited = inside[number, joint] <= slack
        slopes[limited] = 0.0
        middle = (self.kinematics.joint_range.lower + self.kinematics.joint_range.upper) / 2
        slopes[number[limited], joint[limited]] = -np.sign((qs - middle)[number[limited], joint[limited]])
        return slopes

    def _inside(self, qs: Array) -> Array:
        return -self.kinematics.joint_range.shrink(LIMIT_MARGIN).excess(qs)


class Optimizer:
    """Searches the fastest motion between two states, a few steps at a time.

    Args:
        problem: The states, and what limits a motion between them.
        first: A motion between them `(M, n)` [rad] at the places that a course is looked at, however slow.
        duration: Of that way [s].

    Attributes:
        cost: Duration of the best course so far, and what it is too near to something [s].

    Raises:
        NoProfile: No course is anywhere near that way.
    """

    def __init__(self, problem: Problem, first: Array, duration: float) -> None:
        self._problem = problem
        self._transcription = Transcription(problem.start, problem.end, problem.connector.limits)
        course = self._transcription.fit(FIRST_DURATION_SHARE * duration / STEP_COUNT, first)
        if course is None:
            raise NoProfile("no motion follows the way that stops at every corner")
        self._best, self.cost, self._trust = course, np.inf, FIRST_TRUST
        self._gentle: list[Demand] = []
        self._look(course)

    def improve(self, steps: int) -> None:
        """Take up to `steps` steps."""
        for _ in range(steps):
            rows = np.nonzero(self._slack < MAX_DISTANCE)[0]
            slack = self._slack[rows]
            slopes = self._problem.slopes(self._last.qs[rows], slack)
            clear = Demand(slack, rows[:, None], slopes[:, None], np.zeros(len(rows)))
            course = self._transcription.shorten(self._last, [clear, *self._gentle], self._trust)
            if course is None:
                return
            self._trust *= TRUST_DECAY
            self._look(course)

    def _look(self, course: JointCourse) -> None:
        """Take `course` as the last one, and as the best one if it is."""
        self._last, self._slack = course, self._problem.slack(course.qs)
        lacks = [-float(self._slack.min())]
        self._gentle = []
        if self._problem.payload is not None:
            self._gentle = [
                self._problem.payload.demand(course.qs, course.step / SAMPLES_PER_STEP, MAX_DISTANCE)
            ]
            lacks.append(-float(self._gentle[0].slack.min(initial=MAX_DISTANCE)))
        cost = course.duration + VIOLATION_COST * max(0.0, *lacks)
        if cost < self.cost:
            self._best, self.cost = course, cost

    def fly(self, exactly: bool) -> tuple[PointToPoint, ...]:
        """Return the best course as motions between states on it.

        `exactly`: between half steps, each as long as it takes on the course; else between whole steps, each
        as long as it must, which is a little less, on a path that is a little different.

        Raises:
            NoProfile: It cannot be flown.
        """
        least = self._best.step / 2 if exactly else None
        states = [
            _limit_velocity(state, self._problem.connector.limits)
            for state in self._transcription.states(self._best)[:: 1 if exactly else 2]
        ]
        return tuple(self._problem.connector.connect(a, b, least) for a, b in pairwise(states))


def _limit_velocity(state: JointState, limits: JointLimits) -> JointState:
    """Return the nearest state that can be entered and left without exceeding a velocity limit.

    Whoever has an acceleration gains `a² / 2 j` before it is gone.
    """
    most = limits.velocity - state.qdd**2 / (2 * limits.jerk)
    return state._replace(qd=np.clip(state.qd, -most, most))
