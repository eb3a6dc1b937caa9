from __future__ import annotations

import itertools

import numpy as np
import pytest
from joint_states import tool_velocities

from executive.arm import Goal
from executive.motion.kinematics import wrapped
from executive.motion.state import State
from executive.motion.ways import UNLIKE, ways_down

PLACE = (0.55, 0.1, 0.05)


@pytest.fixture
def ways(kinematics, limits, home):
    """The ways to a goal, as a list."""

    def found(goal: Goal, length: float = 0.0):
        return list(ways_down(kinematics, limits, State.rest(home), goal, length))

    return found


def test_each_way_ends_over_the_goal_unlike_those_before_it(ways, kinematics) -> None:
    found = ways(Goal(PLACE))
    assert len(found) > 3
    tips, axes = kinematics.tips(np.array([way.entry.q for way in found]))
    assert np.allclose(tips, PLACE, atol=1e-7)
    assert np.allclose(axes, [0, 0, -1], atol=1e-7)
    for one, other in itertools.combinations(found, 2):
        assert np.max(np.abs(one.entry.q - other.entry.q)) > UNLIKE


def test_the_straight_part_begins_in_the_entry_and_ends_over_the_goal(ways, kinematics) -> None:
    for way in ways(Goal(PLACE, guarded=0.02, speed=0.04), 0.02)[:6]:
        assert way.arrival is not None
        assert way.tail == way.arrival.duration
        for one, other in zip(way.arrival.at(0.0), way.entry, strict=True):
            assert np.array_equal(one, other)
        tips, _ = kinematics.tips(np.array([way.entry.q, way.arrival.at(way.arrival.duration).q]))
        assert np.allclose(tips, [(*PLACE[:2], PLACE[2] + 0.02), PLACE], atol=1e-7)
        assert np.linalg.norm(
            tool_velocities(kinematics, State(*np.array(way.entry)[:, None]))
        ) == pytest.approx(0.04, rel=1e-3)
        assert way.posture is not None
        assert way.posture[0] == kinematics.branch(way.entry.q)
        assert wrapped(way.posture[1] - kinematics.swivel(way.entry.q)) == pytest.approx(0, abs=1e-6)
