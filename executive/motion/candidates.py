"""The ways that may be worth flying from where the arm is to a goal, most promising first."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from executive.cell.arm import Goal
from executive.geometry import Array
from executive.motion.cartesian_line import SAMPLES, Line
from executive.motion.kinematics import Configuration, Kinematics
from executive.motion.limits import JointLimits, min_time
from executive.motion.postures import find_postures, solve_vertical_line
from executive.motion.state import State

UNLIKE = 0.2
"""Joint difference from which two ends of a way are worth trying both [rad]."""


@dataclass(frozen=True, eq=False)
class Way:
    """A way to arrive.

    Attributes:
        estimate: Least time that it takes [s].
        entry: State in which the free part ends.
        arrival: What follows it, straight down, or None.
        configuration: Configuration in which it ends, or None for a named pose.
    """

    estimate: float
    entry: State
    arrival: Line | None
    configuration: Configuration | None

    @property
    def tail(self) -> float:
        """Duration of the straight part [s]."""
        return self.arrival.duration if self.arrival else 0.0


def ways_down(
    kinematics: Kinematics, limits: JointLimits, start: State, goal: Goal, length: float
) -> Iterator[Way]:
    """Yield ways from a state to a goal, the last `length` [m] straight, each unlike those before it.

    Raises:
        Unreachable: There is no posture.
    """
    postures = find_postures(kinematics, goal, length, start.q)
    estimates = min_time(postures.high - start.q, limits)
    taken: list[Array] = []
    for number in np.argsort(estimates, kind="stable"):
        low = postures.low[number]
        if any(np.max(np.abs(low - other)) <= UNLIKE for other in taken):
            continue
        taken.append(low)
        configuration = postures.configurations[number]
        arrival, entry = None, State.rest(low)
        if length > 0:
            chain = solve_vertical_line(kinematics, low, length, SAMPLES, configuration)[::-1]
            arrival = Line(chain, length, limits, goal.speed, enters=True)
            entry = arrival.at(0.0)
        yield Way(float(estimates[number]), entry, arrival, configuration)
