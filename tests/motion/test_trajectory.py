from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.errors import Fault, Unreachable
from executive.motion.limits import JointLimits
from executive.motion.trajectory import Trajectory

WAYPOINTS = np.radians(
    [[0, 20, 0, -90, 0, 70, 0], [40, 40, 20, -60, 10, 60, 90], [40, 45, 20, -60, 0, 60, 90]]
)
UNIFORM = JointLimits(
    np.full(7, 3.0), np.ones(7), np.full(7, 5.0), np.full(7, 50.0), np.ones(7), np.ones(7), ""
)


def test_it_is_at_rest_at_every_waypoint(limits) -> None:
    trajectory = Trajectory(WAYPOINTS, limits)
    for rest, waypoint in zip(trajectory.rests, WAYPOINTS, strict=True):
        q, qd, _ = trajectory.at(rest)
        assert np.allclose(q, waypoint, atol=1e-9)
        assert np.allclose(qd, 0, atol=1e-9)
    assert trajectory.duration == trajectory.rests[-1]


def test_joints_stay_inside_their_limits_and_some_joint_uses_them(limits) -> None:
    trajectory = Trajectory(WAYPOINTS, limits)
    states = [trajectory.at(s) for s in np.arange(0, trajectory.duration, 0.001)]
    speed = np.max(np.abs([state[1] for state in states]) / limits.velocity)
    acceleration = np.max(np.abs([state[2] for state in states]) / limits.acceleration)
    jerk = np.max(np.abs(np.diff([state[2] for state in states], axis=0)) / 0.001 / limits.jerk)
    assert speed <= 1 + 1e-9
    assert acceleration == pytest.approx(1, abs=0.01)
    assert jerk <= 1.001


@given(st.floats(0, 1))
def test_segments_are_straight_in_joint_space(share: float) -> None:
    trajectory = Trajectory(WAYPOINTS[:2], UNIFORM)
    done = trajectory.at(share * trajectory.duration)[0] - WAYPOINTS[0]
    way = WAYPOINTS[1] - WAYPOINTS[0]
    assert np.allclose(done, way * (done @ way) / (way @ way), atol=1e-12)


def test_the_path_has_no_gaps(limits) -> None:
    path = Trajectory(WAYPOINTS, limits).path(math.radians(1))
    assert np.max(np.abs(np.diff(path, axis=0))) <= math.radians(1) + 1e-12
    assert np.array_equal(path[0], WAYPOINTS[0])
    assert np.allclose(path[-1], WAYPOINTS[-1])


def test_a_motion_to_where_the_arm_is_takes_no_time(limits) -> None:
    trajectory = Trajectory([WAYPOINTS[0], WAYPOINTS[0]], limits)
    assert trajectory.duration == 0
    assert np.array_equal(trajectory.at(0.5)[0], WAYPOINTS[0])


def test_leaving_a_joints_range_names_the_joint(limits) -> None:
    goal = np.radians([0, 0, 0, -125, 0, 0, 0])
    with pytest.raises(Unreachable, match=r"joint 4 to 125\.0°; its limit is ±120°"):
        Trajectory([np.zeros(7), goal], limits).check(limits)


def test_what_would_crash_ruckig_is_refused_with_a_sentence(limits) -> None:
    with pytest.raises(Fault, match=r"waypoint 1 of a trajectory has nan for joint 3"):
        Trajectory([np.zeros(7), [0, 0, math.nan, 0, 0, 0, 0]], limits)
    with pytest.raises(Fault, match=r"7 joints, not the shape \(2, 6\)"):
        Trajectory(np.zeros((2, 6)), limits)
    with pytest.raises(Fault, match="asked for the time nan"):
        Trajectory(WAYPOINTS, limits).at(math.nan)
    with pytest.raises(Fault, match="must be positive"):
        Trajectory(WAYPOINTS[:2], limits, [0.0])


def test_a_motion_too_slow_for_ruckig_is_a_fault_with_a_sentence(limits) -> None:
    with pytest.raises(Fault, match="ruckig finds no profile from"):
        Trajectory(WAYPOINTS[:2], limits, [1e-5])
