"""The fake arm goes up, across and down, and takes its time to plan."""

from __future__ import annotations

import math

import numpy as np
import pytest

from executive.arm import Goal, Motion, Task
from executive.clock import STEP
from executive.errors import Fault, Unreachable
from executive.geometry import Array
from executive.messages import Obstacle
from executive.testing.fake_arm import SPEED
from executive.testing.fake_cell import FakeCell, bare_table

LATENCY = bare_table().motion.planning
BESIDE = Goal((0.5, 0.2, 0.03), guarded=0.02, speed=0.05)


def motion_to(fake: FakeCell, goal: Goal | str) -> Motion:
    planning = fake.arm.plan(goal)
    while not planning.ready:
        fake.advance()
    return planning.result()


def go(fake: FakeCell, goal: Goal | str) -> Array:
    """Go to a goal and return where the tool was at every step `(N, 3)` [m]."""
    fake.arm.start(motion_to(fake, goal))
    places = []
    while not fake.arm.at_rest:
        fake.advance()
        places.append(fake.arm.tool_pose.position)
    return np.array(places)


def test_it_goes_up_across_and_down_and_the_last_part_slowly(fake: FakeCell) -> None:
    go(fake, Goal((0.4, -0.2, 0.05)))
    places = go(fake, BESIDE)
    assert places[-1] == pytest.approx(BESIDE.position)
    across = np.hypot(*(places[:, :2] - [0.4, -0.2]).T) > 1e-9
    beside = np.hypot(*(places[:, :2] - [0.5, 0.2]).T) > 1e-9
    assert places[across & beside, 2] == pytest.approx(0.16), "load over wall, with clearance"
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / STEP
    guarded = places[1:, 2] < 0.05 - 1e-9
    assert speeds.max() <= SPEED + 1e-9
    assert speeds[~guarded].max() > 0.9 * SPEED
    assert speeds[guarded] == pytest.approx(0.05, rel=0.02)


def test_the_tool_turns_as_the_goal_says(fake: FakeCell) -> None:
    go(fake, Goal((0.5, 0.0, 0.1), yaw=math.pi / 2))
    assert fake.arm.tool_pose.rotation[:, 0] == pytest.approx([0, -1, 0], abs=1e-9)


def test_a_plan_takes_its_time_unless_it_was_asked_for_before(fake: FakeCell) -> None:
    fake.arm.start(motion_to(fake, "aside"))
    assert np.allclose(fake.arm.destination, fake.arm.poses["aside"].position)
    fake.advance()
    fake.arm.plan_ahead(BESIDE)
    while not fake.arm.at_rest:
        fake.advance()
    assert fake.arm.plan(BESIDE).ready
    planning, before = fake.arm.plan(BESIDE), fake.cell.clock.now
    assert not planning.ready, "a plan made ahead is used once"
    while not planning.ready:
        fake.advance()
    assert fake.cell.clock.now - before == pytest.approx(LATENCY, abs=STEP)


def test_a_plan_for_another_task_or_from_another_place_is_another_plan(fake: FakeCell) -> None:
    among = Task(around=(Obstacle(0.4, -0.2, 0.03, 0.05, "cube-1"),))
    fake.arm.plan_ahead(BESIDE)
    assert not fake.arm.plan(BESIDE, among).ready
    fake.arm.plan_ahead("aside")
    go(fake, BESIDE)
    assert not fake.arm.plan("aside").ready


def test_what_is_out_of_reach_is_said_when_the_plan_is_known(fake: FakeCell) -> None:
    planning = fake.arm.plan(Goal((0.8, 0.4, 0.1)))
    with pytest.raises(Unreachable, match=r"0\.90 m from the base is more than the arm's 0\.85 m"):
        planning.result()


def test_a_motion_that_runs_into_something_ends_half_way_and_the_next_does_not(fake: FakeCell) -> None:
    start = fake.arm.tool_pose.position
    fake.arm.runs_into = "a hand"
    places = go(fake, "aside")
    aside = fake.arm.poses["aside"].position
    assert np.linalg.norm(places[-1] - start) == pytest.approx(np.linalg.norm(aside - start) / 2, rel=0.05)
    assert fake.arm.met == "a hand"
    assert np.allclose(fake.arm.destination, places[-1]), "where it stands now"
    assert np.allclose(go(fake, "aside")[-1], aside)
    assert fake.arm.met is None


def test_it_follows_one_motion_at_a_time_and_none_of_another_arm(fake: FakeCell) -> None:
    class Hop:
        duration = 1.0

    with pytest.raises(Fault, match="the fake arm follows its own planned motions, not a Hop"):
        fake.arm.start(Hop())
    motion = motion_to(fake, "aside")
    fake.arm.start(motion)
    with pytest.raises(Fault, match="the arm was started while it moves"):
        fake.arm.start(motion)
