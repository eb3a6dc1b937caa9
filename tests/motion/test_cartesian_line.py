from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from joint_states import ARM, LIMITS, SOONER, passed, peaks, tool_velocities

from executive.cell.arm import Goal
from executive.geometry import Array
from executive.motion.configurations import CartesianLine, find_configuration_pairs, solve_straight_waypoints


class Descent(NamedTuple):
    """Joint positions evenly spread along a way down, and how long and fast that may be."""

    chain: Array
    length: float
    speed: float


@st.composite
def descents(draw: st.DrawFn) -> Descent:
    """Ways down to places on the workspace, in any posture."""
    place = draw(st.tuples(st.floats(0.42, 0.64), st.floats(-0.22, 0.22), st.floats(0.03, 0.1)))
    length = draw(st.floats(0.005, 0.2))
    postures = find_configuration_pairs(ARM, Goal(place), length, np.zeros(7))
    number = draw(st.integers(0, len(postures.lower_qs) - 1))
    branch = postures.branches[number]
    chain = solve_straight_waypoints(ARM, postures.lower_qs[number], length, branch)[::-1]
    return Descent(chain, length, draw(st.sampled_from([0.03, 0.2, math.inf])))


@given(descents(), st.booleans())
@settings(max_examples=20)
def test_the_tool_goes_straight_down_inside_all_limits(descent: Descent, enters: bool) -> None:
    line = CartesianLine(descent.chain, descent.length, LIMITS, descent.speed, starts_in_motion=enters)
    states = passed(line)
    tips, axes = ARM.compute_tcps_and_axes(states.q)
    assert np.max(np.linalg.norm(tips[:, :2] - tips[-1, :2], axis=1)) < 1e-4
    assert axes[:, 2].max() < -1 + 1e-6
    assert np.all(np.diff(tips[:, 2]) < 1e-9)
    assert tips[0, 2] - tips[-1, 2] == pytest.approx(descent.length, abs=1e-5)
    assert max(peaks(states, LIMITS)) <= 1 + 1e-6
    speeds = np.linalg.norm(tool_velocities(ARM, states), axis=1)
    assert speeds.max() <= descent.speed * 1.003
    for state, place in ((line.state_at(0.0), 0), (line.state_at(line.duration), -1)):
        assert np.allclose(state.q, descent.chain[place], atol=1e-9)
        assert np.allclose(state.qd, 0, atol=1e-6) is not (enters and place == 0)
        assert place == 0 or np.allclose(state.qdd, 0, atol=1e-6)
    times = np.linspace(0, line.duration, 9)
    for values, alone in zip(line.sample(times), zip(*map(line.state_at, times), strict=True), strict=True):
        assert np.allclose(values, np.array(alone), atol=1e-12)


@given(descents())
@settings(max_examples=20)
def test_leaving_it_is_the_same_way_mirrored_in_time(descent: Descent) -> None:
    down = CartesianLine(descent.chain, descent.length, LIMITS, descent.speed, starts_in_motion=True)
    up = CartesianLine(descent.chain[::-1], descent.length, LIMITS, descent.speed, ends_in_motion=True)
    assert up.duration == pytest.approx(down.duration, abs=1e-6)
    gentle = CartesianLine(
        descent.chain[::-1], descent.length, LIMITS, max_acceleration=0.5, ends_in_motion=True
    )
    assert gentle.max_acceleration == 0.5 < up.max_acceleration
    heights = ARM.compute_tcps_and_axes(passed(gentle).q)[0][:-1, 2]
    # The spline through four places advances up to 5 % faster than its parameter.
    assert np.diff(heights, n=2).max() / SOONER**2 <= 0.5 * 1.06
    for s in np.linspace(0, down.duration, 7):
        one, other = down.state_at(s), up.state_at(max(0.0, up.duration - s))
        assert np.allclose(one.q, other.q, atol=1e-6)
        assert np.allclose(one.qd, -other.qd, atol=1e-5)
        assert np.allclose(one.qdd, other.qdd, atol=1e-3)
