from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from joint_states import LIMITS, passed, peaks, positions

from executive.cell.objects import Load, ObjectClass, Obstacle
from executive.geometry import Array, make_tool_down_pose
from executive.motion.clearance_model import ClearanceModel, make_tool_discs
from executive.motion.joints import JointState
from executive.motion.optimizer import OptimizationProblem, Optimizer
from executive.motion.payload import PayloadLimit
from executive.motion.point_to_point import JointLimitError
from executive.motion.trajectory import Trajectory, sample_pieces
from executive.motion.transcription import SAMPLE_FRACTIONS

POST = Obstacle(0.5, 0.0, 0.04, 0.22, "the post")
LEFT, RIGHT, HIGH = (0.5, -0.2, 0.12), (0.5, 0.2, 0.12), 0.32
KIND = ObjectClass("cube", 0.05, 0.0354, mass=0.1)
CUBE = Load(KIND)


@pytest.fixture(scope="module")
def over_the_post(config, kinematics, connector):
    """The gap between two places with a post between them, and the way that stops at every corner."""

    def given(load: Load | None = None) -> tuple[OptimizationProblem, list]:
        branch, _ = kinematics.find_branch(np.radians(config.arm.poses_deg["home"]))

        def state(x: float, y: float, z: float) -> JointState:
            return JointState.at_rest(kinematics.solve([make_tool_down_pose((x, y, z))], (branch, 0.0))[0])

        corners = [state(*LEFT), state(*LEFT[:2], HIGH), state(*RIGHT[:2], HIGH), state(*RIGHT)]
        discs = make_tool_discs(config, load)
        clearance = ClearanceModel(config, (POST,), np.array([LEFT[:2], RIGHT[:2]]), discs)
        payload = PayloadLimit(load, kinematics) if load else None
        problem = OptimizationProblem(
            corners[0],
            corners[-1],
            connector,
            kinematics,
            clearance,
            payload,
        )
        return problem, [connector.connect(a, b) for a, b in pairwise(corners)]

    return given


def improved(problem: OptimizationProblem, corners: list, steps: int = 12) -> Optimizer:
    """A detour after so many steps."""
    duration = sum(piece.duration for piece in corners)
    optimizer = Optimizer(problem, sample_pieces(corners, SAMPLE_FRACTIONS * duration).q, duration)
    optimizer.improve(steps)
    return optimizer


@pytest.mark.parametrize("load", [None, CUBE])
def test_it_is_clear_and_much_faster_than_the_way_that_stops_at_every_corner(over_the_post, load) -> None:
    problem, corners = over_the_post(load)
    direct = problem.connector.connect(problem.start, problem.end)
    assert problem.compute_slack(direct.sample(SAMPLE_FRACTIONS * direct.duration).q).min() < -0.01
    optimizer = improved(problem, corners)
    stopping = sum(piece.duration for piece in corners)
    for exactly in (False, True):
        flown = Trajectory(optimizer.connect_states(keeps_timing=exactly))
        assert direct.duration < flown.duration < 0.8 * stopping
        assert not exactly or flown.duration == pytest.approx(optimizer.cost, abs=0.01)
        qs = flown.require_limits(LIMITS).q
        assert problem.compute_slack(qs).min() > -1e-3
        assert max(peaks(passed(flown), LIMITS)) <= 1 + 1e-6
        assert np.array_equal(flown.start, problem.start.q)
        assert np.allclose(flown.end, problem.end.q, atol=1e-9)


def test_no_detour_follows_a_way_in_no_time(over_the_post) -> None:
    problem, corners = over_the_post()
    first = sample_pieces(corners, SAMPLE_FRACTIONS * sum(piece.duration for piece in corners)).q
    with pytest.raises(
        JointLimitError,
        match="no motion inside the limits approximates the motion with via points",
    ):
        Optimizer(problem, first, 0.1)


@given(positions, st.floats(0, 1))
@settings(max_examples=60)
def test_slopes_are_the_derivatives_of_slack_by_the_joints(over_the_post, q: Array, share: float) -> None:
    problem, _ = over_the_post()
    qs = (problem.start.q + share * (q - problem.start.q))[None]
    h = 1e-5
    here = problem.compute_slack(qs)
    found = problem.compute_gradients(qs, problem.find_nearest_pairs(qs))[0]
    forward = (problem.compute_slack(qs + h * np.eye(7)) - here) / h
    backward = (here - problem.compute_slack(qs - h * np.eye(7))) / h
    smooth = np.abs(forward - backward) < 1e-3  # no kink between
    assert np.allclose(found[smooth], forward[smooth], atol=2e-3)


def test_near_a_joints_limit_that_is_what_slack_and_slopes_tell(over_the_post) -> None:
    problem, _ = over_the_post()
    qs = problem.start.q[None].copy()
    qs[0, 6] = -LIMITS.position.upper[6] + 0.003
    slack = problem.compute_slack(qs)
    assert slack[0] == pytest.approx(0.003 - 0.01)
    assert np.array_equal(problem.compute_gradients(qs, problem.find_nearest_pairs(qs))[0], np.eye(7)[6])
