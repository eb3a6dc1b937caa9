from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from joint_states import ARM, CONFIG, LIMITS

from executive.cell.arm import Goal
from executive.errors import Unreachable
from executive.geometry import Array
from executive.motion.configurations import find_configuration_pairs, find_vertical_waypoints
from executive.motion.joints import Kinematics, build_kinematics

START = np.radians([38, 33, 0, -88, 0, 59, 20])
places = st.tuples(st.floats(0.42, 0.64), st.floats(-0.22, 0.22), st.floats(0.02, 0.1))
yaws = st.none() | st.floats(-math.pi, math.pi)


def arm_within(limit: Array) -> Kinematics:
    limits = CONFIG.arm.limits.model_copy(update={"position_deg": tuple(np.degrees(limit).tolist())})
    arm = CONFIG.arm.model_copy(update={"limits": limits})
    return build_kinematics(CONFIG.model_copy(update={"arm": arm}))


@given(places, yaws, st.floats(0.0, 0.15))
@settings(max_examples=40)
def test_every_posture_points_down_over_the_goal_inside_the_limits(place, yaw, length: float) -> None:
    found = find_configuration_pairs(ARM, Goal(place, () if yaw is None else (yaw,)), length, START)
    for qs, height in ((found.lower_qs, 0.0), (found.upper_qs, length)):
        tips, axes = ARM.compute_tcps_and_axes(qs)
        assert np.allclose(tips, np.add(place, (0, 0, height)), atol=1e-7)
        assert np.allclose(axes, [0, 0, -1], atol=1e-7)
        assert np.all(LIMITS.position.shrink(-1e-9).contains(qs))
        for q in qs[::17] if yaw is not None else ():
            assert np.allclose(
                ARM.compute_tool_pose(q).rotation[:, 1], [-math.sin(yaw), math.cos(yaw), 0], atol=1e-7
            )


def test_a_goal_with_several_yaws_has_the_configurations_of_each() -> None:
    position = (0.5, 0.1, 0.1)
    both = find_configuration_pairs(ARM, Goal(position, (0.3, -0.5)), 0.05, START)
    each = [find_configuration_pairs(ARM, Goal(position, (yaw,)), 0.05, START) for yaw in (0.3, -0.5)]
    assert np.array_equal(both.lower_qs, np.vstack([pairs.lower_qs for pairs in each]))
    assert both.branches == each[0].branches + each[1].branches


def test_a_free_yaw_turns_joint_7_no_more_than_the_way_down_asks_for() -> None:
    start = START.copy()
    start[6] = LIMITS.position.upper[6]
    found = find_configuration_pairs(ARM, Goal((0.5, 0.1, 0.05)), 0.1, start)
    drift = found.upper_qs[:, 6] - found.lower_qs[:, 6]
    last = LIMITS.position.upper[6] - math.radians(1)
    assert np.allclose(np.maximum(found.lower_qs[:, 6], found.upper_qs[:, 6]), last, atol=1e-9)
    assert np.ptp(drift) > 0.01


def test_there_is_no_line_up_where_the_tool_does_not_point_down_or_a_joint_leaves_its_range() -> None:
    tilted = START + np.eye(7)[5] * 0.1
    assert find_vertical_waypoints(ARM, START, 0.1) is not None
    assert find_vertical_waypoints(ARM, tilted, 0.1) is None
    narrow = arm_within(np.minimum(LIMITS.position.upper, np.abs(START) + 0.01))
    assert find_vertical_waypoints(narrow, START, 0.2) is None


@pytest.mark.parametrize(
    ("place", "length", "text"),
    [
        ((0.9, 0.0, 0.114), 0.0, r"(0.900, 0.000, 0.114) m: .* 0\.080 m beyond the reach of the arm"),
        ((0.3, 0.0, 0.114), 0.0, r"(0.300, 0.000, 0.114) m: .* 0\.110 m nearer than joint 4 permits"),
        ((0.5, 0.0, 0.05), 0.9, r"(0.500, 0.000, 0.950) m: .* beyond the reach"),
        ((0.5, 0.0, 0.1), 0.0, r"(0.500, 0.000, 0.100) m: .* leaves joint 6 14\.1° outside ±20°"),
    ],
)
def test_what_cannot_be_reached_says_at_which_height_and_why(place, length: float, text: str) -> None:
    narrow = arm_within(np.radians([170, 120, 170, 120, 170, 20 if place[2] == 0.1 else 120, 175]))
    point, reason = text.split(" m: ")
    with pytest.raises(Unreachable, match=f"{re.escape(point)} m: {reason}"):
        find_configuration_pairs(narrow, Goal(place), length, np.zeros(7))
