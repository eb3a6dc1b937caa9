"""Candidates for the end of a motion, in the order of their minimum durations."""

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
        min_duration: Minimum duration of the free part [s].
        entry: State at the end of the free part.
        arrival: Straight motion down from `entry`, or None.
        configuration: Configuration at the end, or None for given joint positions.
    """

    min_duration: float
    entry: JointState
    arrival: CartesianLine | None
    configuration: Configuration | None

    @property
    def arrival_duration(self) -> float:
        """Duration of `arrival` [s]."""
        return self.arrival.duration if self.arrival else 0.0


def find_candidates(
    kinematics: Kinematics, limits: JointLimits, start: JointState, goal: Goal, length: float
) -> Iterator[Candidate]:
    """Yield candidates for motions to a goal whose last `length` [m] is straight.

    Each candidate differs from all earlier ones by more than `MIN_JOINT_DIFFERENCE`.

    Raises:
        Unreachable: No posture of the arm reaches the goal.
    """
    postures = find_postures(kinematics, goal, length, start.q)
    durations = min_time(postures.high - start.q, limits)
    earlier: list[Array] = []
    for number in np.argsort(durations, kind="stable"):
        low = postures.low[number]
        if any(np.max(np.abs(low - other)) <= MIN_JOINT_DIFFERENCE for other in earlier):
            continue
        earlier.append(low)
        configuration = postures.configurations[number]
        arrival, entry = None, JointState.rest(low)
        if length > 0:
            chain = solve_vertical_line(kinematics, low, length, CHAIN_LENGTH, configuration)[::-1]
            arrival = CartesianLine(chain, length, limits, goal.speed, starts_in_motion=True)
            entry = arrival.at(0.0)
        yield Candidate(float(durations[number]), entry, arrival, configuration)
