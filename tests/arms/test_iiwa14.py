from __future__ import annotations

import math

import numpy as np
import pybullet
import pybullet_data
from hypothesis import given, settings
from hypothesis import strategies as st
from pybullet_utils.bullet_client import BulletClient

from executive.arms.iiwa14 import Iiwa14
from executive.geometry import Pose
from executive.mission.cell_file import load_cell
from executive.text.files import get_shipped_folder

LIMIT = np.radians([170, 120, 170, 120, 170, 120, 175])
ARM = Iiwa14(load_cell(get_shipped_folder() / "cells" / "overhead.yaml").arm, 0.12)
postures = st.tuples(*(st.floats(-limit, limit) for limit in LIMIT)).map(np.array)


def assert_same(one: Pose, other: Pose, tolerance: float = 1e-7) -> None:
    assert np.abs(one.position - other.position).max() < tolerance
    assert np.abs(one.rotation - other.rotation).max() < tolerance


@given(postures)
@settings(max_examples=40)
def test_every_solution_of_a_reachable_pose_reaches_it(q) -> None:
    goal = ARM.compute_tool_pose(q)
    (solutions,), _ = ARM.solve_all([goal], q, math.pi)
    for solution in solutions:
        assert_same(ARM.compute_tool_pose(solution), goal, 1e-6)


@given(postures)
@settings(max_examples=40)
def test_the_configuration_of_a_posture_leads_back_to_it(q) -> None:
    if min(abs(math.sin(q[i])) for i in (1, 3, 5)) < 1e-3:
        return  # straight joints: the posture is not one of a few
    found = ARM.solve([ARM.compute_tool_pose(q)], ARM.find_branch(q))
    assert np.abs(found - q).max() < 1e-5


def test_forward_kinematics_agree_with_pybullet() -> None:
    client = BulletClient(pybullet.DIRECT)
    arm = client.loadURDF(f"{pybullet_data.getDataPath()}/kuka_iiwa/model.urdf", useFixedBase=True)
    rng = np.random.default_rng(1)
    for q in rng.uniform(-LIMIT, LIMIT, (50, 7)):
        for joint, angle in enumerate(q):
            client.resetJointState(arm, joint, angle)
        state = client.getLinkState(arm, 6, computeForwardKinematics=True)
        assert_same(ARM.compute_tool_pose(q), Pose.of(*state[4:6]) @ Pose.of([0, 0, 0.165]), 1e-5)
    client.disconnect()
