"""The ways to move that the planner's are compared with."""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np
import pytest

from executive.arm import Goal
from executive.campaign.motion_article import CYCLE, MOTION, article_peaks
from executive.campaign.motion_rivals import Textbook, floor, textbook, toppra
from executive.cell_config import CellConfig
from executive.errors import InputError
from executive.geometry import Array
from executive.layout import travel_height
from executive.motion.limits import rest_to_rest
from executive.motion.planner import Planner
from executive.motion.postures import find_postures
from executive.motion.trajectory import peaks

TOUCH, DROP = Goal((0.5, 0.1, 0.051)), Goal((0.24, -0.48, 0.065))
STAND = Goal((0.24, 0.48, 0.065))


@dataclass
class Place:
    """An arm that stands over a bin, and what it may do."""

    planner: Planner
    start: Array
    height: float

    def textbook(self) -> Textbook:
        kinematics, limits = self.planner.kinematics, self.planner.limits
        return textbook(kinematics, limits, self.start, TOUCH, DROP, self.height)


@pytest.fixture(scope="module")
def place(overhead: CellConfig) -> Place:
    planner = Planner(overhead)
    start = find_postures(planner.kinematics, STAND, 0.1, np.zeros(7)).low[0]
    return Place(planner, start, travel_height(overhead))


def test_the_textbook_passes_over_every_place_at_travel_height_and_straight_above_it(place):
    way = place.textbook()
    fetch, _ = place.planner.kinematics.tips(way.fetch)
    carry, _ = place.planner.kinematics.tips(way.carry)
    assert fetch == pytest.approx(
        np.array([STAND.position, (0.24, 0.48, place.height), (0.5, 0.1, place.height), TOUCH.position])
    )
    assert carry == pytest.approx(
        np.array([TOUCH.position, (0.5, 0.1, place.height), (0.24, -0.48, place.height), DROP.position])
    )
    assert (way.fetch[0] == place.start).all()


def test_who_stops_at_every_corner_takes_the_sum_of_its_moves_and_uses_its_limits_up(place):
    way, limits = place.textbook(), place.planner.limits
    ride = way.stopping(limits)
    moves = np.concatenate([np.diff(way.fetch, axis=0), np.diff(way.carry, axis=0)])
    assert ride.time == pytest.approx(rest_to_rest(moves, limits).sum(), abs=1e-6)
    assert np.max([peaks(states, limits).max(axis=1) for states in ride.states], axis=0) == pytest.approx(
        [1, 1, 1], abs=1e-3
    )


def test_the_floor_is_under_everything_and_lower_still_with_the_first_posture_free(place):
    kinematics, limits = place.planner.kinematics, place.planner.limits
    ride, free = floor(kinematics, limits, place.start, TOUCH, DROP)
    way = place.textbook()
    passing = sum(toppra(chain, limits)[0] for chain in (way.fetch, way.carry))
    assert 0.5 < free <= ride.time < passing < way.stopping(limits).time
    first, last = ride.states[0].q[0], ride.states[1].q[-1]
    assert first == pytest.approx(place.start)
    assert kinematics.forward(last).position == pytest.approx(DROP.position, abs=1e-6)
    assert ride.states[1].q[-1, 6] == pytest.approx(place.start[6])


def test_toppra_passes_the_corners_inside_velocity_but_knows_no_jerk(place):
    way, limits = place.textbook(), place.planner.limits
    duration, states = toppra(way.fetch, limits)
    for corner in way.fetch:
        assert np.abs(states.q - corner).max(axis=1).min() < 0.02
    velocity, acceleration, jerk = peaks(states, limits).max(axis=1)
    assert velocity <= 1.02 and acceleration < 1.5 and jerk > 5
    assert len(states.q) == pytest.approx(duration * 240, abs=2)


def test_toppra_that_is_not_installed_is_asked_for(place, monkeypatch):
    monkeypatch.setitem(sys.modules, "toppra", None)
    with pytest.raises(InputError, match='compares with the package "toppra"; install it: uv sync'):
        toppra(place.textbook().fetch, place.planner.limits)


def test_the_article_throws_the_arm_far_beyond_its_limits(place, overhead):
    assert (MOTION, CYCLE) == (6.5, 7.25)
    velocity, acceleration, jerk = article_peaks(overhead, place.textbook(), place.planner.limits)
    assert velocity > 3 and acceleration > 50 and jerk > 1000
