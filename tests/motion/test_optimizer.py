from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from joint_states import LIMITS, positions

from executive.cell.arm import JointState
from executive.cell.objects import Obstacle
from executive.geometry import Array, make_tool_down_pose
from executive.motion.clearance_model import ClearanceModel, make_tool_discs
from executive.motion.optimizer import MotionProblem

POST = Obstacle(0.5, 0.0, 0.04, 0.22, "the post")
LEFT = (0.5, -0.2, 0.12)
RIGHT = (0.5, 0.2, 0.12)


@pytest.fixture(scope="module")
def over_the_post(config, kinematics, connector):
    """The gap between two places with a post between them."""
    branch, _ = kinematics.find_branch(np.radians(config.arm.poses_deg["home"]))
    poses = [make_tool_down_pose(place) for place in (LEFT, RIGHT)]
    start, _ = kinematics.solve(poses, (branch, 0.0))
    discs = make_tool_discs(config, None)
    clearance = ClearanceModel(config, (POST,), np.array([LEFT[:2], RIGHT[:2]]), discs)
    return MotionProblem(JointState.at_rest(start), connector, kinematics, clearance)


@given(positions, st.floats(0, 1))
@settings(max_examples=60)
def test_slopes_are_the_derivatives_of_slack_by_the_joints(over_the_post, q: Array, share: float) -> None:
    problem = over_the_post
    qs = (problem.start.q + share * (q - problem.start.q))[None]
    h = 1e-5
    here = problem.find_nearest_pairs(qs, math.inf).slack
    found = problem.compute_gradients(qs, problem.find_nearest_pairs(qs))[0]
    forward = (problem.find_nearest_pairs(qs + h * np.eye(7), math.inf).slack - here) / h
    backward = (here - problem.find_nearest_pairs(qs - h * np.eye(7), math.inf).slack) / h
    smooth = np.abs(forward - backward) < 1e-3  # no kink between
    assert np.allclose(found[smooth], forward[smooth], atol=2e-3)


def test_near_a_joints_limit_that_is_what_slack_and_slopes_tell(over_the_post) -> None:
    problem = over_the_post
    qs = problem.start.q[None].copy()
    qs[0, 6] = -LIMITS.position.upper[6] + 0.003
    slack = problem.find_nearest_pairs(qs, math.inf).slack
    assert slack[0] == pytest.approx(0.003 - 0.01)
    assert np.array_equal(problem.compute_gradients(qs, problem.find_nearest_pairs(qs))[0], np.eye(7)[6])
