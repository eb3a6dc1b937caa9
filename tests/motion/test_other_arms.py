"""The planner with an arm of six joints, whose limits are asymmetric."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from joint_states import passed, peaks
from six_joint_arm import SixJointArm

from executive.cell.arm import Goal, Task
from executive.cell.arm_config import LimitsConfig
from executive.cell.config import CellConfig
from executive.cell.objects import ObjectClass, Obstacle
from executive.mission.cell_file import load_cell
from executive.motion.joints import JointLimits, Kinematics
from executive.motion.planner import Planner

LIMITS = LimitsConfig(
    source="Invented; like those of a Panda, some do not include 0.",
    min_position_deg=(-150, -60, 20, -170, -20, -90),
    position_deg=(170, 110, 150, 170, 120, 175),
    velocity_deg=(120, 120, 120, 180, 180, 200),
    acceleration=(8, 8, 10, 15, 15, 20),
    jerk=(80, 80, 100, 150, 150, 200),
    stop_acceleration=(12, 12, 15, 20, 20, 25),
    stop_jerk=(160, 160, 200, 300, 300, 400),
)
CUBE = ObjectClass("cube", 0.05, 0.0354)
HOME = np.radians([20.0, -10.0, 110.0, 0.0, 80.0, 0.0])
"""The tool points down."""


@pytest.fixture(scope="module")
def six(config: CellConfig) -> CellConfig:
    changes = {"limits": LIMITS, "poses_deg": {"home": tuple(np.degrees(HOME).tolist())}}
    return config.model_copy(update={"arm": config.arm.model_copy(update=changes)})


@pytest.fixture(scope="module")
def arm(six: CellConfig) -> Kinematics:
    return SixJointArm(six.tool.length, JointLimits.from_config(LIMITS).position)


def test_motions_of_six_joints_reach_their_goals_within_asymmetric_limits(
    six: CellConfig, arm: Kinematics
) -> None:
    checked = []
    planner, limits = (
        Planner(six, lambda path, task: checked.append(path), arm),
        JointLimits.from_config(LIMITS),
    )
    rng, q = np.random.default_rng(3), HOME
    for number in range(12):
        x, y = rng.uniform((0.42, -0.22), (0.64, 0.22)).tolist()
        wall = Obstacle(0.4, float(rng.choice([-0.25, 0.25])), 0.05, 0.15, "the wall")
        goal, task = Goal((x, y, 0.053), guarded_length=0.015, guarded_speed=0.04), Task(obstacles=(wall,))
        if number % 2:
            bin = list(six.bins.values())[number % len(six.bins)].position
            goal, task = Goal((bin[0], bin[1], 0.08)), Task(CUBE, 4.0, (wall,))
        motion = planner.plan(q, goal, task)
        states = passed(motion)
        assert states.q.shape[1] == 6
        assert limits.position.contains(states.q).all()
        assert max(peaks(states, limits)) <= 1 + 1e-6
        assert arm.compute_tool_pose(motion.end).position == pytest.approx(goal.position, abs=1e-6)
        assert arm.compute_tool_pose(motion.end).rotation[2, 2] == pytest.approx(-1)
        q = motion.end
    assert all(path.shape[1] == 6 for path in checked)


@pytest.mark.parametrize("y", [-0.2, 0.2])
def test_an_arm_with_the_slowest_joints_finds_its_way(missions: Path, y: float) -> None:
    config = load_cell(missions / "cells" / "ur5e.yaml")
    limits = config.arm.limits.model_copy(update={"velocity_deg": (1.0,) * 6})
    slow = config.model_copy(update={"arm": config.arm.model_copy(update={"limits": limits})})
    goal = Goal((0.62, y, 0.05), guarded_length=0.01, guarded_speed=0.02)
    assert Planner(slow).plan(np.radians(config.arm.poses_deg["home"]), goal).duration > 10
