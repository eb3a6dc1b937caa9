"""Goals of the arm and obstacles: objects, bins, free places; the order of targets."""

from __future__ import annotations

import math

import numpy as np
import pytest
from at_hand import look, pick

from executive.cell.arm import Goal
from executive.cell.objects import BIN_THICKNESS, Target
from executive.manipulation.grasps import choose_grasp, make_bin_goal
from executive.manipulation.motions import make_task, make_transport_task
from executive.manipulation.tool_goals import (
    DROP_HEIGHT,
    MIN_GAP,
    list_obstacles,
    make_put_down_goal,
    make_slot_goal,
    predict_object_count,
    sort_by_tour,
    sort_pickable_targets,
)
from executive.station.planner_service import PlannedArm
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.approach import Approach
from skills.put_down import PutDown
from skills.release import Release
from skills.transit import Transit

SAFE = (0.45, -0.30)


@pytest.fixture
def held(fake: FakeCell) -> str:
    """A cube in the tool."""
    return picked(fake, fake.world.put("cube", 0.5, 0.0).label)


def picked(fake: FakeCell, label: str) -> str:
    """Pick the first object of that class that a look shows in the workspace; return its item."""
    target = next(one for one in look(fake, "full") if one.label == label and one.position[1] > -0.2)
    return pick(fake, target)


def test_what_is_put_down_one_after_another_stands_side_by_side(fake: FakeCell, held: str) -> None:
    places = []
    item = held
    for _ in range(4):
        run_skill(PutDown(held=item), fake)
        places.append(tuple(next(row for row in fake.ledger.list_items() if row.item == item).position[:2]))
        fake.world.put("cube", 0.5, 0.1)
        item = picked(fake, "cube")
    assert places[0] == pytest.approx(SAFE)
    radius = fake.cell.classes["cube"].radius
    gaps = [math.dist(a, b) for n, a in enumerate(places) for b in places[:n]]
    assert min(gaps) >= 2 * radius + MIN_GAP - 1e-6
    assert max(math.dist(place, SAFE) for place in places) < 0.2
    assert not any(bin.contains(place) for place in map(np.array, places) for bin in fake.cell.bins.values())


def test_a_place_out_of_reach_is_not_chosen(
    fake: FakeCell, held: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        PlannedArm, "describe_unreachable", lambda arm, goal: "too far" if goal.position[0] <= SAFE[0] else ""
    )
    goal = make_put_down_goal(fake.cell, fake.cell.classes["cube"], 0.01, held)
    assert goal.position[0] > SAFE[0]


def test_the_descent_is_fast_once_a_touch_confirmed_the_height_until_an_attempt_fails(fake: FakeCell) -> None:
    for y in (-0.1, 0.1):
        fake.world.put("cube", 0.5, y)
    first, second = look(fake, "full")
    assert choose_grasp(fake.cell, second)[0].goal.fast_length == 0.0
    run_skill(Approach(target=first), fake)
    goal = choose_grasp(fake.cell, second)[0].goal
    motion = fake.cell.motion
    assert goal.position == pytest.approx((*second.position[:2], 0.035))
    assert goal.position[2] + goal.guarded_length == pytest.approx(0.05 + motion.descent)
    assert goal.guarded_speed == motion.descent_speed
    assert goal.fast_length == pytest.approx(motion.descent - motion.slow_descent)
    assert goal.slow_length == pytest.approx(motion.slow_descent + 0.015)
    fake.cell.ledger.record_failed_pick(second.item)
    assert choose_grasp(fake.cell, second)[0].goal.fast_length == 0.0


def test_what_goes_onto_a_layer_hangs_as_far_above_it_as_the_first_ones_above_the_floor(
    fake: FakeCell,
) -> None:
    box = fake.cell.bins["red_bin"]
    first = make_slot_goal(box, 1, 0.05, max_object_height=0.07)
    second = make_slot_goal(box, len(box.slots) + 1, 0.05, max_object_height=0.07)
    floor = float(box.position[2]) + BIN_THICKNESS
    assert first == Goal((*map(float, box.slots[1]), floor + 0.05 + DROP_HEIGHT))
    assert second.position == pytest.approx((*box.slots[1], floor + 0.07 + 0.05 + DROP_HEIGHT))
    assert make_slot_goal(box, 1, 0.05, 0.07, drop_height=0.03).position[2] == pytest.approx(
        floor + 0.05 + 0.03
    )


def names(fake: FakeCell, but: str | None = None) -> list[str]:
    return [obstacle.name for obstacle in list_obstacles(fake.cell, but)]


def test_what_stands_on_the_table_is_in_the_way_but_for_what_is_to_be_touched(
    fake: FakeCell, targets: list[Target]
) -> None:
    assert names(fake) == ["cube-1", "duck-1"]
    _, task = choose_grasp(fake.cell, targets[0])
    assert task.target is not None
    assert (task.target.name, make_task(fake.cell).target) == ("cube-1", None)
    (duck,) = task.obstacles
    kind = fake.cell.classes["duck"]
    assert (duck.name, duck.radius) == ("duck-1", kind.radius)
    assert (duck.x, duck.y, duck.top) == pytest.approx((0.6, 0.15, kind.height))


def test_what_is_carried_is_the_load_and_in_nobodys_way(fake: FakeCell, targets: list[Target]) -> None:
    assert make_task(fake.cell).load is None
    pick(fake, targets[0])
    task = make_task(fake.cell)
    assert task == make_transport_task(fake.cell, "cube-1")
    assert task.load is not None
    assert (task.load.label, task.holding_force) == ("cube", 7.9)
    assert [obstacle.name for obstacle in task.obstacles] == ["duck-1"]
    fake.tool.force = 3.0
    assert make_task(fake.cell).holding_force == 3.0


def test_what_lies_in_a_bin_is_in_the_way_as_high_as_it_is_piled(fake: FakeCell) -> None:
    box = fake.cell.bins["red_bin"]
    height = max(kind.height for kind in fake.cell.classes.values())  # anything may lie there
    for number in range(len(box.slots) + 1):
        fake.world.put("cube", 0.5, 0.0)
        (target,) = look(fake)
        pick(fake, target)
        assert len(list_obstacles(fake.cell, target.item)) == min(number, len(box.slots)), "itself left out"
        run_skill(Transit(held=target.item, bin="red_bin"), fake)
        run_skill(Release(held=target.item, bin="red_bin"), fake)
    tops = {(obstacle.x, obstacle.y): obstacle.top for obstacle in list_obstacles(fake.cell)}
    assert [tops[(x, y)] for x, y in box.slots] == pytest.approx(
        [BIN_THICKNESS + 2 * height, *[BIN_THICKNESS + height] * (len(box.slots) - 1)]
    )


def test_what_hangs_over_a_bin_counts_as_let_go_there_but_for_its_own_way(
    fake: FakeCell, targets: list[Target]
) -> None:
    pick(fake, targets[0])
    assert predict_object_count(fake.cell, "red_bin") == 0, "it hangs over the table"
    run_skill(Transit(held="cube-1", bin="red_bin"), fake)
    first, second = fake.cell.bins["red_bin"].slots[:2]
    assert (predict_object_count(fake.cell, "red_bin"), predict_object_count(fake.cell, "blue_bin")) == (1, 0)
    assert predict_object_count(fake.cell, "red_bin", "cube-1") == 0
    assert np.allclose(make_bin_goal(fake.cell, "red_bin", "cube-1", None).position[:2], first)
    assert np.allclose(make_bin_goal(fake.cell, "red_bin", "duck-1", None).position[:2], second)
    before = list_obstacles(fake.cell)
    run_skill(Release(held="cube-1", bin="red_bin"), fake)
    assert list_obstacles(fake.cell) == before
    assert predict_object_count(fake.cell, "red_bin") == 1


@pytest.mark.parametrize(("y", "first"), [(0.05, "duck-1"), (0.2, "cube-1")])
def test_the_shortest_tour_may_begin_with_a_farther_target(fake: FakeCell, y: float, first: str) -> None:
    """The red bin of the cube is far from the duck; the yellow bin of the duck is nearer to the cube.

    From y = 0.05 m, the tours measure 0.57 m and 0.46 m; from the position of the cube, 0.42 m and 0.61 m.
    """
    fake.world.put("cube", 0.5, 0.2)
    fake.world.put("duck", 0.5, -0.15)
    targets = look(fake, "full")
    fake.cell.arm.start(fake.cell.arm.plan(Goal((0.5, y, 0.3))).result())
    assert [target.item for target in sort_pickable_targets(fake.cell, targets)] == ["cube-1", "duck-1"]
    assert sort_by_tour(fake.cell, targets)[0].item == first
