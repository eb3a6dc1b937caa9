from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from joint_states import positions

from executive.cell.arm import JointState
from executive.geometry import Array
from executive.motion.trajectory import Trajectory, plan_braking

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
