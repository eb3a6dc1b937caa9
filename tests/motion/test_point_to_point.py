from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from joint_states import LIMITS, passed, peaks, states

from executive.cell.arm import JointState
from executive.errors import Fault
from executive.motion.trajectory import Connector, JointLimitError

CONNECTOR = Connector(LIMITS)
STILL = JointState.at_rest(np.zeros(7))


@given(states(), states())
@settings(max_examples=60)
def test_it_joins_two_states_inside_the_limits(start: JointState, end: JointState) -> None:
    motion = CONNECTOR.connect(start, end)
    for state, wanted in ((motion.state_at(0.0), start), (motion.state_at(motion.duration), end)):
        for one, other in zip(state, wanted, strict=True):
            assert np.allclose(one, other, atol=1e-6)
    assert max(peaks(passed(motion), LIMITS)) <= 1 + 1e-6
    times = np.linspace(0, motion.duration, 9)
    for values, alone in zip(
        motion.sample(times), zip(*map(motion.state_at, times), strict=True), strict=True
    ):
        assert np.array_equal(values, np.array(alone))


@given(states(), states(), st.floats(0, 8))
@settings(max_examples=30)
def test_a_motion_takes_the_requested_duration(start: JointState, end: JointState, least: float) -> None:
    fastest = CONNECTOR.connect(start, end).duration
    slower = CONNECTOR.connect(start, end, least).duration
    # Some durations in between cannot be: a moving joint may have to turn back first.
    assert slower >= max(fastest, least) - 1e-9
    assert CONNECTOR.connect(start, end).duration == fastest, "nothing of it is left for the next question"


@pytest.mark.parametrize(
    ("end", "least"),
    [(STILL._replace(qd=1.01 * LIMITS.velocity), None), (JointState.at_rest(np.full(7, 0.3)), 1e5)],
)
def test_a_state_too_fast_and_a_motion_too_slow_have_no_profile(end: JointState, least: float | None) -> None:
    with pytest.raises(
        JointLimitError, match=r"finds no valid profile from \[0\. .*\] to \[0\.[ 3].*\] rad: "
    ):
        CONNECTOR.connect(STILL, end, least)


def test_a_profile_that_is_too_fast_between_its_phases_counts_for_none() -> None:
    """Ruckig's own would be too fast by 0.6 % where the acceleration changes sign."""
    ends = [JointState.at_rest(np.zeros(7)) for _ in range(2)]
    moving = (0.0, -1.67968043, -3.33422395), (-0.27431039, -1.24049521, 8.54397608)
    for state, third in zip(ends, moving, strict=True):
        for values, value in zip(state, third, strict=True):
            values[2] = value
    assert max(peaks(passed(CONNECTOR.connect(*ends)), LIMITS)) <= 1 + 1e-6
    with pytest.raises(JointLimitError, match="the profile exceeds a velocity limit"):
        CONNECTOR.connect(*ends, min_duration=0.16881258)


@pytest.mark.parametrize("values", [np.full(7, math.nan), np.array([math.inf, *[0.0] * 6]), np.zeros(6)])
@pytest.mark.parametrize("field", JointState._fields)
@pytest.mark.parametrize("side", [0, 1])
def test_what_would_crash_ruckig_never_reaches_it(monkeypatch, side: int, field: str, values) -> None:
    connector = Connector(LIMITS)
    monkeypatch.setattr(connector, "_ruckig", None)
    ends = [STILL, STILL]
    ends[side] = STILL._replace(**{field: values})
    with pytest.raises(Fault, match=r"a motion needs states of 7 finite numbers, not \["):
        connector.connect(*ends)
