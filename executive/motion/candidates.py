"""Candidates for the end of a motion: joint positions and straight arrivals that reach the goal."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from executive.cell.arm import Goal
from executive.geometry import Array
from executive.motion.arm_model import BranchKey, Kinematics
from executive.motion.cartesian_line import CartesianLine
from executive.motion.configurations import find_configuration_pairs, solve_vertical_waypoints
from executive.motion.joints import JointLimits, JointState, compute_min_time

MIN_JOINT_DIFFERENCE = 0.2
"""Minimum difference between two candidates in the joint that differs most [rad]."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A candidate for the end of a motion that consists of a free part and an optional straight arrival.

    Attributes:
        min_duration: Minimum duration of the free part [s].
        free_part_end: Joint state at the end of the free part.
        arrival: Straight motion of the tool downwards from `free_part_end`, or None.
        branch: Branch of the inverse kinematics at the end, or None for given joint positions.
    """

    min_duration: float
    free_part_end: JointState
    arrival: CartesianLine | None
    branch: BranchKey | None

    @property
    def arrival_duration(self) -> float:
        """Duration of `arrival` [s]."""
        return self.arrival.duration if self.arrival else 0.0


def find_candidates(
    kinematics: Kinematics, limits: JointLimits, start: JointState, goal: Goal, length: float
) -> Iterator[Candidate]:
    """Yield candidates for motions from `start` to a goal, in the order of their minimum durations.

    The arrival is the last `length` [m] of each motion; 0: no arrival.

    Raises:
        Unreachable: No joint configuration reaches the goal.
    """
    pairs = find_configuration_pairs(kinematics, goal, length, start.q)
    durations = compute_min_time(pairs.upper_qs - start.q, limits)
    previous_qs: list[Array] = []
    for index in np.argsort(durations, kind="stable"):
        goal_q, branch = pairs.lower_qs[index], pairs.branches[index]
        if any(np.max(np.abs(goal_q - q)) <= MIN_JOINT_DIFFERENCE for q in previous_qs):
            continue
        previous_qs.append(goal_q)
        arrival, free_part_end = None, JointState.at_rest(goal_q)
        if length > 0:
            waypoints = solve_vertical_waypoints(kinematics, goal_q, length, branch)[::-1]
            arrival = CartesianLine(waypoints, length, limits, goal.guarded_speed, starts_in_motion=True)
            free_part_end = arrival.state_at(0.0)
        yield Candidate(float(durations[index]), free_part_end, arrival, branch)
