"""Of executive/motion/search.py: which motion is tried first; what they are is for test_planner.py."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

from executive.arm import Goal, Task
from executive.messages import Load, ObjectClass
from executive.motion.seal import Hold
from executive.motion.search import Search

CUBE = ObjectClass("cube", 0.05, 0.0354, mass=0.1)
BIN = Goal((0.24, -0.44, 0.08))
PLACES = [(0.45, -0.2), (0.55, 0.0), (0.62, 0.0), (0.62, 0.2)]


@pytest.fixture(scope="module")
def flights(config, limits, planner, home):
    """The first two motions from a place on the table into the bin: those over the best detour."""

    def found(x: float, y: float, load: Load) -> tuple:
        picked = planner.plan(home, Goal((x, y, 0.053), guarded=0.015, speed=0.04)).end
        search = Search(config, planner.kinematics, limits, picked, BIN, Task(load))
        return tuple(islice(search.candidates(), 2))

    return found


def test_with_a_weak_seal_that_flight_comes_first_which_is_faster_as_gently_as_the_seal_asks(
    flights, kinematics
) -> None:
    load, slower_at_first = Load(CUBE, 2.4), 0
    hold = Hold(load, kinematics)
    for place in PLACES:
        first, second = flights(*place, load)
        assert hold.gentle(first).duration <= hold.gentle(second).duration
        slower_at_first += first.duration > second.duration
    assert slower_at_first > 0  # else it is not the seal that decides


def test_with_a_strong_seal_the_faster_flight_comes_first(flights) -> None:
    durations = np.array([[flight.duration for flight in flights(*place, Load(CUBE))] for place in PLACES])
    assert np.all(durations[:, 0] <= durations[:, 1])
