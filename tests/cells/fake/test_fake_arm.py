"""The fake arm goes up, across and down, and takes its time to plan."""

from __future__ import annotations

import math

import numpy as np
import pytest

from executive.cell.arm import Goal, Motion, Task
from executive.cell.bins import BIN_THICKNESS
from executive.cell.clock import STEP
from executive.cell.objects import Load, Obstacle
from executive.cells.fake.arm import MAX_TOOL_SPEED
from executive.cells.fake.cell import FakeCell, load_empty_cell
from executive.errors import Blocked, Fault, Unreachable
from executive.geometry import Array, make_tool_down_pose

LATENCY = load_empty_cell().motion.planning_time
BESIDE = Goal((0.5, 0.2, 0.03), guarded_length=0.02, guarded_speed=0.05)


def motion_to(fake: FakeCell, goal: Goal | str, task: Task = Task()) -> Motion:
    planning = fake.arm.plan(goal, task)
    while not planning.ready:
        fake.advance()
    return planning.result()


def go(fake: FakeCell, goal: Goal | str, task: Task = Task()) -> Array:
    """Go to a goal and return where the tool was at every step `(N, 3)` [m]."""
    fake.arm.start(motion_to(fake, goal, task))
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
    assert speeds.max() <= MAX_TOOL_SPEED + 1e-9
    assert speeds[~guarded].max() > 0.9 * MAX_TOOL_SPEED
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
    among = Task(obstacles=(Obstacle(0.4, -0.2, 0.03, 0.05, "cube-1"),))
    fake.arm.plan_ahead(BESIDE)
    assert not fake.arm.plan(BESIDE, among).ready
    fake.arm.plan_ahead("aside")
    go(fake, BESIDE)
    assert not fake.arm.plan("aside").ready


def test_what_is_out_of_reach_is_said_when_the_plan_is_known(fake: FakeCell) -> None:
    planning = fake.arm.plan(Goal((0.8, 0.4, 0.1)))
    with pytest.raises(Unreachable, match=r"the goal is 0\.90 m from the base, the arm reaches 0\.85 m"):
        planning.result()


def hold_cube(fake: FakeCell) -> Task:
    """Let the tool hold a cube that stands on the table, and return the task of carrying it."""
    fake.world.held_object = fake.world.put("cube", 0.5, 0.0)
    fake.arm.set_tool_pose(make_tool_down_pose((0.5, 0.0, 0.05)))
    return Task(Load(fake.cell.classes["cube"]))


@pytest.mark.parametrize(
    ("goal", "text"),
    [
        (Goal((0.5, 0.2, -0.01)), "tool 0.010 m into the table, with the tool at (0.500, 0.200, -0.010) m"),
        (Goal((0.5, 0.2, -0.01), guarded_length=0.05, guarded_speed=0.05), "tool 0.010 m into the table, "),
        (Goal((0.24, -0.48, 0.002)), "tool 0.003 m into red_bin, with the tool at (0.240, -0.480, 0.002) m"),
        (Goal((0.1175, -0.48, 0.03)), "tool 0.009 m into red_bin, "),
    ],
    ids=["table", "table, guarded", "floor of a bin", "wall of a bin"],
)
def test_the_tool_enters_neither_table_nor_bins(fake: FakeCell, goal: Goal, text: str) -> None:
    with pytest.raises(Blocked) as raised:
        motion_to(fake, goal)
    assert str(raised.value).startswith(f"the motion would bring the {text}")


@pytest.mark.parametrize(
    ("goal", "text"),
    [
        (Goal((0.5, 0.0, 0.02)), "0.030 m into the table, with the tool at (0.500, 0.000, 0.020) m"),
        (Goal((0.24, -0.48, 0.05)), "0.005 m into red_bin, with the tool at (0.240, -0.480, 0.050) m"),
        (Goal((0.15, -0.48, 0.06)), "0.005 m into red_bin, "),
    ],
    ids=["table", "floor of a bin", "wall of a bin"],
)
def test_a_load_enters_neither_table_nor_bins(fake: FakeCell, goal: Goal, text: str) -> None:
    task = hold_cube(fake)
    with pytest.raises(Blocked) as raised:
        motion_to(fake, goal, task)
    assert str(raised.value).startswith(f"the motion would bring the held cube {text}")


def test_a_load_may_lie_on_the_table_and_on_the_floor_of_a_bin(fake: FakeCell) -> None:
    task = hold_cube(fake)
    for place in ((0.5, 0.0, 0.1), (0.5, 0.0, 0.05), (0.24, -0.48, 0.05 + BIN_THICKNESS)):
        assert go(fake, Goal(place), task)[-1] == pytest.approx(place)


def test_what_is_pressed_into_the_table_can_be_lifted_and_not_be_pressed_deeper(fake: FakeCell) -> None:
    task = hold_cube(fake)
    fake.arm.set_tool_pose(make_tool_down_pose((0.5, 0.0, 0.045)))
    with pytest.raises(Blocked, match=r"the held cube 0\.006 m into the table"):
        motion_to(fake, Goal((0.5, 0.0, 0.044)), task)
    assert go(fake, Goal((0.5, 0.0, 0.1)), task)[-1, 2] == pytest.approx(0.1)


def test_a_load_that_the_plan_did_not_know_of_stops_the_arm_where_it_touches(fake: FakeCell) -> None:
    hold_cube(fake)
    places = go(fake, Goal((0.5, 0.0, 0.02)))
    assert fake.arm.collision is not None
    assert fake.arm.collision.startswith(
        "the held cube ran into the table, with the tool at (0.500, 0.000, 0.04"
    )
    assert places[:, 2].min() == pytest.approx(0.05, abs=MAX_TOOL_SPEED * STEP)
    assert places[:, 2].min() >= 0.05
    assert fake.arm.commands == ["start", "stop"]
    go(fake, Goal((0.5, 0.0, 0.1)))
    assert fake.arm.collision is None


def test_it_goes_to_a_named_pose_straight_or_else_over_the_wall(fake: FakeCell) -> None:
    aside = fake.arm.poses["aside"].position
    straight = go(fake, "aside")
    way = (aside - straight[0]) / np.linalg.norm(aside - straight[0])
    assert np.linalg.norm(np.cross(straight - straight[0], way), axis=1).max() < 1e-9
    task = hold_cube(fake)
    go(fake, Goal((0.3, 0.4, 0.065)), task)
    places = go(fake, "aside", task)
    beside = np.hypot(*(places[:, :2] - [0.3, 0.4]).T) > 1e-9
    assert places[beside, 2].min() == pytest.approx(0.16, abs=1e-3)
    assert np.allclose(places[-1], aside)
    assert np.allclose(fake.arm.tool_pose.rotation, fake.arm.poses["aside"].rotation)


def test_a_motion_that_runs_into_something_ends_half_way_and_the_next_does_not(fake: FakeCell) -> None:
    start = fake.arm.tool_pose.position
    fake.arm.next_obstacle = "a hand"
    places = go(fake, "aside")
    aside = fake.arm.poses["aside"].position
    assert np.linalg.norm(places[-1] - start) == pytest.approx(np.linalg.norm(aside - start) / 2, rel=0.05)
    assert fake.arm.collision == "a hand"
    assert np.allclose(fake.arm.destination, places[-1]), "where it stands now"
    assert np.allclose(go(fake, "aside")[-1], aside)
    assert fake.arm.collision is None


def test_it_follows_one_motion_at_a_time_and_none_of_another_arm(fake: FakeCell) -> None:
    class Hop:
        duration = 1.0

    with pytest.raises(Fault, match="the fake arm follows its own planned motions, not a Hop"):
        fake.arm.start(Hop())
    motion = motion_to(fake, "aside")
    fake.arm.start(motion)
    with pytest.raises(Fault, match="the arm was started while it moves"):
        fake.arm.start(motion)
