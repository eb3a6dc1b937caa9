from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from joint_states import LIMITS, positions, states

from executive.cell.arm import JointState
from executive.cell.device_config import STEP
from executive.errors import Fault, Unreachable
from executive.motion.trajectory import (
    Connector,
    JointLimitError,
    Trajectory,
    compute_peak_fractions,
    downsample_path,
)

CONNECTOR = Connector(LIMITS)
A, B, C = np.radians([[0, 20, 0, -90, 0, 70, 0], [40, 40, 20, -60, 10, 60, 90], [40, 45, 20, -60, 0, 60, 90]])
MOVING = JointState((A + B) / 2, (B - A) / 3, np.full(7, 0.2))


def by_way_of(*passing: JointState) -> Trajectory:
    """A motion from A to B, in pieces that meet in the given states."""
    ends = [JointState.at_rest(A), *passing, JointState.at_rest(B)]
    return Trajectory([CONNECTOR.connect(one, other) for one, other in pairwise(ends)])


@pytest.mark.parametrize(
    ("field", "off"), [("q", "position differs by 0.01"), ("qd", "velocity"), ("qdd", "acceleration")]
)
def test_pieces_that_do_not_meet_are_a_fault(field: str, off: str) -> None:
    first = CONNECTOR.connect(JointState.at_rest(A), MOVING)
    wrong = MOVING._replace(**{field: getattr(MOVING, field) + 0.01})
    second = CONNECTOR.connect(wrong, JointState.at_rest(B))
    with pytest.raises(Fault, match=f"pieces 1 and 2 do not meet; the joint {off}"):
        Trajectory([first, second])


@given(states(), st.floats(0.2, 1.0))
@settings(max_examples=20)
def test_slowed_it_takes_the_same_path_in_more_time(between: JointState, rate: float) -> None:
    """The chain rule: velocities are multiplied by the rate, accelerations by its square."""
    trajectory = by_way_of(between)
    slow = trajectory.make_slower_copy(rate)
    assert slow.duration == pytest.approx(trajectory.duration / rate)
    assert np.array_equal(slow.start, trajectory.start)
    assert np.allclose(slow.end, trajectory.end, atol=1e-9)
    trajectory.guarded_start_time = 0.2
    assert trajectory.make_slower_copy(rate).guarded_start_time == pytest.approx(0.2 / rate)
    assert slow.guarded_start_time == math.inf
    for s in np.linspace(0, trajectory.duration, 13):
        fast = trajectory.state_at(s)
        q, qd, qdd = slow.state_at(s / rate)
        assert np.allclose(q, fast.q, atol=1e-6)
        assert np.allclose(qd, rate * fast.qd, atol=1e-5)
        assert np.allclose(qdd, rate**2 * fast.qdd, atol=1e-4)
    states = slow.samples
    times = [*np.arange(0, slow.duration, STEP), slow.duration]
    for values, wanted in zip(states, zip(*map(slow.state_at, times), strict=True), strict=True):
        assert np.allclose(values, wanted, atol=1e-6)
    measured = np.diff(states.q[:-1], axis=0) / STEP
    assert np.allclose(measured, (states.qd[1:-1] + states.qd[:-2]) / 2, atol=LIMITS.jerk.max() * STEP**2)


def test_a_motion_to_where_the_arm_is_takes_no_time() -> None:
    trajectory = Trajectory([CONNECTOR.connect(JointState.at_rest(A), JointState.at_rest(A))])
    assert trajectory.duration == 0
    assert np.array_equal(trajectory.state_at(0.5).q, A)
    assert np.array_equal(trajectory.require_limits(LIMITS).q, [A])


@given(st.integers(0, 6), st.floats(0.3, 0.9))
@settings(max_examples=30)
def test_leaving_a_joints_range_between_two_states_inside_it_is_seen(joint: int, share: float) -> None:
    """Where a joint turns back, ruckig's own extremes are too small."""
    edge = JointState.at_rest(np.zeros(7))
    edge.q[joint] = -LIMITS.position.upper[joint] + 0.01
    leaving = JointState.at_rest(edge.q.copy())
    leaving.qd[joint] = share * LIMITS.velocity[joint]
    back = CONNECTOR.connect(leaving, JointState.at_rest(np.zeros(7)))
    trajectory = Trajectory([CONNECTOR.connect(edge, leaving), back])
    limit = round(np.degrees(LIMITS.position.upper[joint]))
    with pytest.raises(Unreachable, match=rf"take joint {joint + 1} to -\d+\.\d°; its limit is ±{limit}°"):
        trajectory.require_limits(LIMITS)


@pytest.mark.parametrize("limit", ["velocity", "acceleration", "jerk"])
def test_a_motion_outside_a_limit_cannot_be_flown_and_the_text_names_the_joint(limit: str) -> None:
    motion = by_way_of(MOVING)
    assert np.array_equal(motion.require_limits(LIMITS).q, motion.samples.q)
    most = compute_peak_fractions(motion.samples, LIMITS)[
        ("velocity", "acceleration", "jerk").index(limit), 4
    ]
    less = getattr(LIMITS, limit).copy()
    less[4] *= most / 1.01
    with pytest.raises(JointLimitError, match=rf"the {limit} of joint 5 would be 1\.010 times its limit"):
        motion.require_limits(replace(LIMITS, **{limit: less}))


@given(positions, st.floats(0.01, 0.2))
@settings(max_examples=30)
def test_a_thinned_path_has_no_gaps_and_no_more_points_than_it_needs(end, spacing: float) -> None:
    qs = Trajectory([CONNECTOR.connect(JointState.at_rest(A), JointState.at_rest(end))]).samples.q
    kept = downsample_path(qs, spacing)
    step = np.max(np.abs(np.diff(qs, axis=0)), initial=0.0)
    assert np.array_equal(kept[[0, -1]], qs[[0, -1]])
    assert np.max(np.abs(np.diff(kept, axis=0))) <= max(spacing, step) + 1e-12
    wider = np.max(np.abs(kept[2:] - kept[:-2]), axis=1)
    assert np.all(wider[:-1] > spacing)
