"""Limits of the joints, and the least time of a move within them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from joint_states import LIMITS, shares

from executive.cell.arm import JointState
from executive.motion.joints import JointLimits
from executive.motion.trajectory import Connector

CONNECTOR = Connector(LIMITS)


def test_limits_are_the_cell_files_in_radians(config, limits: JointLimits) -> None:
    for side, sign in zip(limits.position, (-1, 1), strict=True):
        assert np.allclose(np.degrees(side), sign * np.array([170, 120, 170, 120, 170, 120, 175]))
    assert np.allclose(np.degrees(limits.velocity), [85, 85, 100, 75, 130, 135, 135])
    for name in ("acceleration", "jerk", "stop_acceleration", "stop_jerk"):
        assert np.array_equal(getattr(limits, name), getattr(config.arm.limits, name)), name


@given(shares, st.floats(-4, 0.5))
@settings(max_examples=150)
def test_the_closed_form_is_ruckigs_duration(share, power: float) -> None:
    change = share * 10**power
    found = CONNECTOR.connect(JointState.at_rest(np.zeros(7)), JointState.at_rest(change)).duration
    # Ruckig takes moves of less than a billionth of a radian for none.
    assert LIMITS.compute_min_time(change) == pytest.approx(
        found, rel=1e-6, abs=5e-3 if found < 5e-3 else 1e-8
    )
