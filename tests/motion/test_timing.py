from __future__ import annotations

import math

import numpy as np
import pytest

from executive.motion.timing import rest_to_rest
from executive.motion.trajectory import Trajectory


@pytest.mark.parametrize("rate", [math.inf, 10.0, 0.5, 0.02])
@pytest.mark.parametrize("far", [1.0, 0.1, 0.01, 0.0001])
def test_the_closed_form_is_ruckigs_duration(limits, rate: float, far: float) -> None:
    rng = np.random.default_rng(int(far * 1e4))
    for change in rng.uniform(-1, 1, (10, 7)) * far:
        trajectory = Trajectory([np.zeros(7), change], limits, [rate])
        assert rest_to_rest(change, limits, rate) == pytest.approx(trajectory.duration, abs=1e-9)


def test_no_move_takes_no_time(limits) -> None:
    assert np.array_equal(rest_to_rest(np.zeros((3, 7)), limits), np.zeros(3))
