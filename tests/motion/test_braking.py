from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from joint_states import positions

from executive.cell.arm import Goal
from executive.geometry import Array
from executive.motion.braking import plan_braking
from executive.motion.joints import JointState
from executive.motion.trajectory import Trajectory

STEP = 1 / 240


def commands(trajectory: Trajectory, s: float, times: Array) -> Array:
    """Joint positions of the control steps around a stop from path time `s`."""
    before = [trajectory.state_at(max(0.0, s - k * STEP)).q for k in range(4, -1, -1)]
    during = [trajectory.state_at(float(time)).q for time in times]
    return np.array([*before, *during, *[during[-1]] * 4])


def assert_short_and_inside(trajectory: Trajectory, s: float, limits) -> None:
    """A stop from path time `s` takes half a second at most, goes never back, and keeps the stop limits."""
    times = plan_braking(trajectory, s, limits)
    assert len(times) * STEP <= 0.5 + 1e-9
    assert np.all(np.diff([s, *times]) >= 0)
    assert times[-1] <= trajectory.duration + 1e-9
    accelerations = np.diff(commands(trajectory, s, times), 2, axis=0) / STEP**2
    assert np.max(np.abs(accelerations) / limits.stop_acceleration) <= 1.0
    assert np.max(np.abs(np.diff(accelerations, axis=0)) / STEP / limits.stop_jerk) <= 1.02


@given(positions, positions, st.floats(-1.5, 0), st.floats(0, 1))
@settings(max_examples=60)
def test_a_halt_at_any_tick_is_short_and_inside_the_stop_limits(
    connector, limits, start, end, power: float, share: float
) -> None:
    end = start + (end - start) * 10**power
    trajectory = Trajectory([connector.connect(JointState.at_rest(start), JointState.at_rest(end))])
    assert_short_and_inside(trajectory, STEP * int(share * trajectory.duration / STEP), limits)


def test_a_halt_on_a_way_around_something_is_inside_the_stop_limits_too(planner, limits, home) -> None:
    picked = planner.plan(home, Goal((0.55, 0.15, 0.055), guarded_length=0.02, guarded_speed=0.04)).end
    trajectory = planner.plan(picked, Goal((0.24, -0.44, 0.08)))
    for s in np.arange(0.0, trajectory.duration, 10 * STEP):
        assert_short_and_inside(trajectory, float(s), limits)
    shares = (0.0, 0.2, 0.5, 0.8, 0.99)
    stops = [plan_braking(trajectory, share * trajectory.duration, limits) for share in shares]
    assert [len(times) for times in stops] == [5, 83, 83, 39, 2]
    ends = [0.01, 0.331967, 0.573134, 0.803889, 0.803889]
    assert [times[-1] for times in stops] == pytest.approx(ends, abs=1e-5)
