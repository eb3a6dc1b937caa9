"""The fake arm goes up, across and down on straight joint paths."""

from __future__ import annotations

import math

import numpy as np
import pytest
from at_hand import plan_motion

from executive.cell.arm import Goal, Task
from executive.cell.device_config import STEP
from executive.cell.objects import BIN_THICKNESS, Obstacle
from executive.errors import Blocked, Unreachable
from executive.geometry import Array
from executive.motion.planner import JOINT_SPEED
from executive.testing.fake_cell import FakeCell, load_empty_cell

ASIDE = np.radians(load_empty_cell().arm.poses_deg["aside"])
BESIDE = Goal((0.5, 0.2, 0.03), guarded_length=0.02, guarded_speed=0.05)


def move(fake: FakeCell, goal: Goal | str, task: Task = Task()) -> tuple[Array, Array]:
    """Go to a goal; return joint positions `(N, n)` [rad] and tool positions `(N, 3)` [m] of all steps."""
    fake.cell.arm.start(plan_motion(fake, goal, task))
    states = []
    while not fake.arm.at_rest:
        fake.advance()
        states.append((fake.arm.q, fake.arm.tool_pose.position))
    qs, places = zip(*states, strict=True)
    return np.array(qs), np.array(places)


def hold_cube(fake: FakeCell) -> Task:
    """Let the tool hold a cube that stands on the table, and return the task of carrying it."""
    fake.world.held_object = fake.world.put("cube", 0.5, 0.0)
    fake.arm.set_tool_position(np.array((0.5, 0.0, 0.05)))
    return Task(fake.cell.classes["cube"])


def test_it_goes_up_across_and_down_and_the_last_part_slowly(fake: FakeCell) -> None:
    move(fake, Goal((0.4, -0.2, 0.05)))
    qs, places = move(fake, BESIDE)
    assert places[-1] == pytest.approx(BESIDE.position)
    across = np.hypot(*(places[:, :2] - [0.4, -0.2]).T) > 0.005
    beside = np.hypot(*(places[:, :2] - [0.5, 0.2]).T) > 0.005
    assert places[across & beside, 2].min() > 0.12, "above the walls"
    joint_speeds = np.abs(np.diff(qs, axis=0)).max(axis=1) / STEP
    assert joint_speeds.max() == pytest.approx(JOINT_SPEED)
    is_guarded = places[1:, 2] < 0.05 - 1e-3
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / STEP
    assert speeds[is_guarded][:-1] == pytest.approx(0.05, rel=0.05)


def test_a_named_pose_is_reached_on_a_straight_line_of_the_joints(fake: FakeCell) -> None:
    start = fake.arm.q
    qs, _ = move(fake, "aside")
    assert qs[-1] == pytest.approx(ASIDE)
    shares = (qs - start)[:, 0] / (qs[-1] - start)[0]
    assert qs == pytest.approx(start + shares[:, None] * (qs[-1] - start))


def test_the_tool_turns_as_the_goal_says(fake: FakeCell) -> None:
    move(fake, Goal((0.5, 0.0, 0.1), yaws=(math.pi / 2,)))
    assert fake.arm.tool_pose.rotation[:, 0] == pytest.approx([0, -1, 0], abs=1e-9)


@pytest.mark.parametrize(
    ("goal", "is_loaded", "message"),
    [
        (Goal((0.5, 0.2, -0.01)), False, "the table, with the tool at"),
        (Goal((0.5, 0.2, -0.01), guarded_length=0.05, guarded_speed=0.05), False, "the table"),
        (Goal((0.24, -0.48, 0.002)), False, "the floor of red_bin"),
        (Goal((0.1175, -0.48, 0.03)), False, "red_bin"),
        (Goal((0.5, 0.0, 0.02)), True, "the table"),
        (Goal((0.15, -0.48, 0.06)), True, "red_bin"),
    ],
    ids=["table", "table, guarded", "floor of a bin", "wall of a bin", "load, table", "load, wall of a bin"],
)
def test_neither_tool_nor_load_enters_table_or_bins(
    fake: FakeCell, goal: Goal, is_loaded: bool, message: str
) -> None:
    task = hold_cube(fake) if is_loaded else Task()
    with pytest.raises(Blocked, match=rf"too near to {message}"):
        plan_motion(fake, goal, task)


def test_it_goes_over_a_known_obstacle_or_not_at_all(fake: FakeCell) -> None:
    _, places = move(fake, "aside")
    x, y, _ = places[len(places) // 2]
    low, high = (Task(obstacles=(Obstacle(x, y, 0.03, top, "pole-1"),)) for top in (0.27, 0.6))
    _, over = move(fake, "home", low)
    assert over[:, 2].max() > 0.3 > places[:, 2].max()
    with pytest.raises(Blocked, match="pole-1"):
        plan_motion(fake, "aside", high)


def test_a_load_may_lie_on_the_table_and_on_the_floor_of_a_bin(fake: FakeCell) -> None:
    task = hold_cube(fake)
    for place in ((0.5, 0.0, 0.1), (0.5, 0.0, 0.05), (0.24, -0.48, 0.05 + BIN_THICKNESS)):
        _, places = move(fake, Goal(place), task)
        assert places[-1] == pytest.approx(place)
        held = fake.world.held_object
        assert held is not None
        assert held.position == pytest.approx(np.subtract(place, (0.0, 0.0, 0.025)))


def test_a_goal_out_of_reach_is_unreachable(fake: FakeCell) -> None:
    far = Goal((0.8, 0.4, 0.1))
    with pytest.raises(Unreachable, match="beyond the reach"):
        plan_motion(fake, far)
    assert "beyond the reach" in fake.cell.arm.describe_unreachable(far)
    assert fake.cell.arm.describe_unreachable(BESIDE) == ""


def test_a_motion_that_runs_into_something_ends_half_way_and_the_next_does_not(fake: FakeCell) -> None:
    start = fake.arm.q
    fake.arm.next_obstacle = "a hand"
    qs, places = move(fake, "aside")
    assert qs[-1] == pytest.approx((start + ASIDE) / 2, abs=0.02)
    assert (fake.arm.collision, fake.arm.contact_point) == ("a hand", places[-1].tolist())
    assert fake.cell.arm.destination == pytest.approx(places[-1])
    qs, _ = move(fake, "aside")
    assert qs[-1] == pytest.approx(ASIDE)
    assert fake.arm.collision is None
