from __future__ import annotations

import numpy as np

from executive.motion.state import State


def test_a_state_of_rest_neither_moves_nor_is_about_to() -> None:
    q = np.linspace(-1, 1, 7)
    state = State.rest(q)
    assert np.array_equal(state.q, q)
    assert np.array_equal(state.qd, np.zeros(7))
    assert np.array_equal(state.qdd, np.zeros(7))
