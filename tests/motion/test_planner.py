from __future__ import annotations

import math
import re

import numpy as np
import pytest

from executive.cell import Via
from executive.errors import Blocked, Fault, Unreachable
from executive.geometry import tool_down
from executive.motion.planner import Planner
from executive.motion.trajectory import Trajectory


@pytest.fixture
def home(config):
    return np.radians(config.arm.poses_deg["home"])


def pick(x: float, y: float, yaw: float | None = None) -> list[Via]:
    return [
        Via(np.array([x, y, 0.11]), yaw),
        Via(np.array([x, y, 0.07])),
        Via(np.array([x, y, 0.045]), speed=0.03),
    ]


def tool(planner: Planner, trajectory: Trajectory, since: float = 0.0):
    qs = np.array([trajectory.at(s)[0] for s in np.arange(since, trajectory.duration, 1 / 240)])
    return planner.kinematics.positions(qs)


def test_the_tool_passes_every_via_pointing_down(planner, home) -> None:
    vias = pick(0.6, -0.2, yaw=0.4)
    trajectory = planner.plan(home, vias)
    for via, q in zip(vias, trajectory.waypoints[1:], strict=True):
        X_WT = planner.kinematics.forward(q)
        assert np.allclose(X_WT.position, via.position, atol=1e-9)
        assert np.allclose(X_WT.rotation[:, 2], [0, 0, -1], atol=1e-9)
        assert np.allclose(X_WT.rotation[:, 1], [-math.sin(0.4), math.cos(0.4), 0], atol=1e-9)


def test_a_free_yaw_leaves_joint_7_alone_and_is_shared_by_a_descent(planner, home) -> None:
    trajectory = planner.plan(home, pick(0.6, -0.2))
    assert trajectory.waypoints[1, 6] == pytest.approx(home[6])
    turned = [planner.kinematics.forward(q).rotation for q in trajectory.waypoints[1:]]
    assert np.allclose(turned[0], turned[1], atol=1e-9)
    assert np.allclose(turned[0], turned[2], atol=1e-9)


def test_a_guarded_descent_is_straight_and_even(planner, home) -> None:
    for x, y in [(0.43, -0.21), (0.63, 0.21), (0.5, 0.0)]:
        trajectory = planner.plan(home, pick(x, y))
        positions = tool(planner, trajectory, since=trajectory.rests[2])
        assert np.max(np.linalg.norm(positions[:, :2] - [x, y], axis=1)) < 0.0005
        speeds = np.linalg.norm(np.diff(positions, axis=0), axis=1) * 240
        assert speeds.max() <= 0.03 + 1e-6
        assert speeds[20:-20].min() > 0.029


def test_a_lift_keeps_the_posture_of_the_arm(planner, home) -> None:
    picked = planner.plan(home, pick(0.6, -0.2)).end
    lift = planner.plan(picked, [Via(np.array([0.6, -0.2, 0.15]))])
    assert planner.kinematics.branch(lift.end) == planner.kinematics.branch(picked)
    assert planner.kinematics.swivel(lift.end) == pytest.approx(planner.kinematics.swivel(picked), abs=1e-6)


def test_the_choice_of_posture_beats_the_natural_elbow(planner, home, limits) -> None:
    goal = Via(np.array([0.2, -0.44, 0.2]))
    chosen = planner.plan(home, [goal]).duration
    straight = planner.kinematics.grid(tool_down(goal.position), np.zeros(1))[2, 0]
    assert chosen < Trajectory([home, straight], limits).duration


def test_the_same_question_gets_the_same_answer(planner, home) -> None:
    one, other = (planner.plan(home, pick(0.5, 0.1)).waypoints for _ in range(2))
    assert np.array_equal(one, other)


def test_the_next_best_way_is_taken_when_the_best_is_blocked(kinematics, limits, home) -> None:
    asked = []

    def clearance(path, carrying) -> None:
        asked.append(path)
        if len(asked) < 3:
            raise Blocked("too near")

    found = Planner(kinematics, limits, clearance).plan(home, [Via(np.array([0.5, 0.0, 0.2]))])
    assert len(asked) == 3
    assert np.array_equal(found.path(math.radians(1)), asked[-1])
    assert np.max(np.abs(asked[2][-1] - asked[0][-1])) > 0.2


def test_when_all_ways_are_blocked_the_error_is_the_best_ones(kinematics, limits, home) -> None:
    asked = []

    def clearance(path, carrying) -> None:
        asked.append(path)
        raise Blocked(f"way {len(asked)} is too near")

    with pytest.raises(Blocked, match=r"way 1 is too near; of \d+ ways tried none is free$"):
        Planner(kinematics, limits, clearance).plan(home, [Via(np.array([0.5, 0.0, 0.2]))])
    assert 1 < len(asked) <= 16


def test_an_unreachable_via_says_how_far_off_it_is(planner, home) -> None:
    far = Via(np.array([0.9, 0.0, 0.114]))
    with pytest.raises(Unreachable, match=re.escape("0.080 m farther than the arm is long")):
        planner.plan(home, [far])
    with pytest.raises(Unreachable, match=re.escape("0.080 m farther than the arm is long")):
        planner.require_reachable([Via(np.array([0.5, 0.0, 0.2])), far])


def test_every_bin_and_the_whole_workspace_can_be_reached(planner, config) -> None:
    spots = [bin.position[:2] for bin in config.bins.values()]
    spots += [(x, y) for x in config.table.x for y in config.table.y]
    for x, y in spots:
        planner.require_reachable([Via(np.array([x, y, 0.2])), Via(np.array([x, y, 0.04]))])


def test_a_motion_without_vias_is_a_fault(planner, home) -> None:
    with pytest.raises(Fault, match="without any via"):
        planner.plan(home, [])


def test_a_joint_goal_can_be_reached_after_a_lift(planner, home) -> None:
    picked = planner.plan(home, pick(0.6, 0.1)).end
    back = planner.plan_joints(picked, home, first=[Via(np.array([0.6, 0.1, 0.1]))])
    assert len(back.waypoints) == 3
    assert np.allclose(back.end, home)
    assert tool(planner, back)[5:, 2].min() > 0.045
