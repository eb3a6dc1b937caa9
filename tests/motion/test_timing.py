from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from joint_states import LIMITS, shares

from executive.motion.free import Connector
from executive.motion.limits import rest_to_rest
from executive.motion.state import State

CONNECTOR = Connector(LIMITS)


@given(shares, st.floats(-4, 0.5))
@settings(max_examples=200, deadline=None)
def test_the_closed_form_is_ruckigs_duration(share, power: float) -> None:
    change = share * 10**power
    found = CONNECTOR.connect(State.rest(np.zeros(7)), State.rest(change)).duration
    # Ruckig takes moves of less than a billionth of a radian for none.
    assert rest_to_rest(change, LIMITS) == pytest.approx(found, rel=1e-6, abs=5e-3 if found < 5e-3 else 1e-8)


def test_many_moves_at_once_are_the_same_as_one_by_one() -> None:
    changes = np.random.default_rng(1).uniform(-1, 1, (3, 4, 7))
    found = rest_to_rest(changes, LIMITS)
    assert found.shape == (3, 4)
    assert found[2, 1] == rest_to_rest(changes[2, 1], LIMITS)


def test_no_move_takes_no_time(limits) -> None:
    assert np.array_equal(rest_to_rest(np.zeros((3, 7)), limits), np.zeros(3))
