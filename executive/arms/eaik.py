"""Analytic inverse kinematics by EAIK (https://github.com/OstermD/EAIK), an optional package.

EAIK decomposes arms with six joints. An arm with seven joints is solved for many positions of its last joint.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from executive.arms.numeric import ChainKinematics
from executive.arms.urdf import ARMS_EXTRA
from executive.cell.arm_config import ArmConfig
from executive.errors import InputError
from executive.geometry import Array, Pose

LOCKED_STEP_FACTOR = 3.0
"""Distance between the positions of the last joint of an arm with seven joints, as a multiple of the distance
between redundancy angles: with 36 positions, 99.96 % of the reachable poses of a Panda have a solution."""


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

    lower = float(kinematics.joint_range.lower[-1])
    upper = float(kinematics.joint_range.upper[-1])
    if count not in (6, 7) or not get_robot((lower + upper) / 2).has_known_decomposition():
        raise InputError(
            f"the solver eaik does not know the arm {arm.arm} with {count} joints; use the solver `numeric`"
        )

    def find_solutions(goal: Pose, q_seed: Array, angle_step: float) -> Array:
        del q_seed
        positions: Sequence[float] = [0.0]
        if count == 7:
            positions = np.arange(lower, upper, LOCKED_STEP_FACTOR * angle_step).tolist()
        matrix = np.eye(4)
        matrix[:3, :3] = goal.rotation
        matrix[:3, 3] = goal.position
        answers = [get_robot(position).calculate_IK(matrix) for position in positions]
        # A least-squares answer is no solution.
        found = [
            q for answer in answers for q, is_bad in zip(answer.Q, answer.is_LS, strict=True) if not is_bad
        ]
        return np.array(found).reshape(-1, count)

    kinematics.find_solutions = find_solutions
    kinematics.solver_name = "eaik"
    return kinematics


def build_best(arm: ArmConfig, tool_length: float, min_link_distance: float | None = None) -> ChainKinematics:
    """Return the kinematics of an arm that EAIK solves if possible, otherwise with the numerical search."""
    with contextlib.suppress(InputError):
        return build_analytic(arm, tool_length, min_link_distance)
    return ChainKinematics(arm, tool_length, min_link_distance)
