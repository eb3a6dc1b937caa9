"""Analytic inverse kinematics by EAIK (https://github.com/OstermD/EAIK), an optional package.

EAIK decomposes arms with six joints. An arm with seven joints is solved for many positions of its last joint.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from executive.arms.numeric import ChainKinematics, make_matrix
from executive.cell.arm_config import ArmConfig
from executive.errors import InputError
from executive.geometry import Array, Pose
from executive.plugins import ARMS_EXTRA

LOCKED_STEP_FACTOR = 0.7
"""Distance between the positions of the last joint of an arm with seven joints, as a multiple of the distance
between redundancy angles. With 103 positions (3.5 degrees), EAIK finds 99.4 % of the solutions of a Panda."""
MIN_LOCKED_STEP = math.radians(1.0)
"""Minimum distance between these positions [rad]."""


def build_analytic(
    arm: ArmConfig, tool_length: float, min_link_distance: float | None = None
) -> ChainKinematics:
    """Return the kinematics of an arm that EAIK solves; a `executive.motion.joints.KinematicsFactory`."""
    try:
        from eaik.pybindings.EAIK import Robot
    except ImportError:
        advice = f"install it with `uv sync --extra {ARMS_EXTRA}`, or use the solver `numeric`"
        raise InputError(f'the solver "eaik" of the arm {arm.arm} needs the package eaik; {advice}') from None
    kinematics = ChainKinematics(arm, tool_length, min_link_distance)
    count = arm.joint_count
    frames = [Pose.identity()]
    for offset in kinematics.offsets:
        frames.append(frames[-1] @ offset)
    X_WT = frames[-1] @ kinematics.X_nT
    axes = np.array([frame.rotation[:, 2] for frame in frames[1:]])
    points = np.array([*(frame.position for frame in frames), X_WT.position])
    displacements = np.diff(points, axis=0)
    robots: dict[float, Any] = {}

    def get_robot(last_position: float) -> Any:
        """Return EAIK's robot; the last one of seven joints is locked at `last_position` [rad]."""
        if last_position not in robots:
            locked = [(count - 1, last_position)] if count == 7 else []
            robots[last_position] = Robot(axes.T, displacements.T, X_WT.rotation, locked, True)
        return robots[last_position]

    if count not in (6, 7) or not get_robot(0.0).has_known_decomposition():
        raise InputError(
            f"the solver eaik does not know the arm {arm.arm} with {count} joints; use the solver `numeric`"
        )

    def find_starts(goal: Pose, q_seed: Array, angle_step: float) -> Array:
        del q_seed
        positions: Sequence[float] = [0.0]
        if count == 7:
            positions = np.arange(
                -math.pi, math.pi, max(LOCKED_STEP_FACTOR * angle_step, MIN_LOCKED_STEP)
            ).tolist()
        matrix = make_matrix(goal)
        # An answer without an exact solution is a least-squares solution: with seven joints, there often is a
        # solution at another position of the last joint.
        answers = [q for position in positions for q in get_robot(position).calculate_IK(matrix).Q]
        return np.array(answers).reshape(-1, count)

    kinematics.find_starts = find_starts
    kinematics.solver_name = "eaik"
    return kinematics


def build_best(arm: ArmConfig, tool_length: float, min_link_distance: float | None = None) -> ChainKinematics:
    """Return the kinematics of an arm that EAIK solves if possible, otherwise with the numerical search."""
    with contextlib.suppress(InputError):
        return build_analytic(arm, tool_length, min_link_distance)
    return ChainKinematics(arm, tool_length, min_link_distance)
