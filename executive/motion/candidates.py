"""Candidate arrivals at a goal, the most promising first."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from executive.cell.arm import Goal
from executive.geometry import Array
from executive.motion.arm_model import Configuration, Kinematics
from executive.motion.cartesian_line import CHAIN_LENGTH, CartesianLine
from executive.motion.limits import JointLimits, min_time
from executive.motion.postures import find_postures, solve_vertical_line
from executive.motion.state import JointState

MIN_JOINT_DIFFERENCE = 0.2
"""Minimum difference of a joint between two candidates [rad]."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A candidate for the end of a motion.

    Attributes:
        estimate: Minimum time of a motion to it [s].
        entry: State in which the free part ends.
        arrival: What follows it, straight down, or None.
        configuration: Configuration in which it ends, or None for a named pose.
    """

    estimate: float
    entry: JointState
    arrival: CartesianLine | None
    configuration: Configuration | None

    @property
    def tail(self) -> float:
        """Duration of the straight part [s]."""
        return self.arrival.duration if self.arrival else 0.0


def find_candidates(
    kinematics: Kinematics, limits: JointLimits, start: JointState, goal: Goal, length: float
) -> Iterator[Candidate]:
    """Yield candidates for motions to a goal, the last `length` [m] straight, each unlike those before it.

    Raises:
        Unreachable: There is no posture.
    """
    postures = find_postures(kinematics, goal, length, start.q)
    estimates = min_time(postures.high - start.q, limits)
    taken: list[Array] = []
    for number in np.argsort(estimates, kind="stable"):
        low = postures.low[number]
        if any(np.max(np.abs(low - other)) <= MIN_JOINT_DIFFERENCE for other in taken):
            continue
        taken.append(low)
        configuration = postures.configurations[number]
        arrival, entry = None, JointState.rest(low)
        if length > 0:
            chain = solve_vertical_line(kinematics, low, length, CHAIN_LENGTH, configuration)[::-1]
            arrival = CartesianLine(chain, length, limits, goal.speed, enters=True)
            entry = arrival.at(0.0)
        yield Candidate(float(estimates[number]), entry, arrival, configuration)
