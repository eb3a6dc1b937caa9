"""Where the arm goes to: onto an object, into a bin, to a free place."""

from __future__ import annotations

import math

import numpy as np
import pytest
from at_hand import look, pick

from executive.cell.arm import Goal
from executive.cell.bins import BIN_THICKNESS
from executive.cell.objects import ObjectClass
from executive.cells.fake.arm import FakeArm
from executive.cells.fake.cell import FakeCell
from executive.manipulation.tool_goals import (
    DROP_HEIGHT,
    MIN_GAP,
    OVERTRAVEL,
    make_approach,
    make_object_goal,
    make_put_down_goal,
    make_slot_goal,
)
from executive.testing.run_skill import run_skill
from skills.approach import Approach
from skills.put_down import PutDown

SAFE = (0.45, -0.30)


@pytest.fixture
def held(fake: FakeCell) -> str:
    """A cube in the tool."""
    return picked(fake, fake.world.put("cube", 0.5, 0.0).label)


def picked(fake: FakeCell, label: str) -> str:
    """Pick the first object of that class that a look shows in the workspace; return its item."""
    target = next(one for one in look(fake, "full") if one.label == label and one.position[1] > -0.2)
    return pick(fake, target)


def test_it_is_the_safe_place_if_that_is_free(fake: FakeCell, held: str) -> None:
    cube = fake.cell.classes["cube"]
    assert make_put_down_goal(fake.cell, cube, 0.01, held).position == pytest.approx((*SAFE, 0.05 + 0.01))


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


def test_where_nothing_is_free_it_is_the_safe_place_all_the_same(
    fake: FakeCell, held: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.manipulation.tool_goals.GRID_HALF_WIDTH", 0)
    run_skill(PutDown(held=held), fake)
    fake.world.put("cube", 0.5, 0.1)
    item, cube = picked(fake, "cube"), fake.cell.classes["cube"]
    assert make_put_down_goal(fake.cell, cube, 0.01, item).position[:2] == pytest.approx(SAFE)


def test_a_place_out_of_reach_is_not_chosen(
    fake: FakeCell, held: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        FakeArm, "describe_unreachable", lambda arm, goal: "too far" if goal.position[0] <= SAFE[0] else ""
    )
    goal = make_put_down_goal(fake.cell, fake.cell.classes["cube"], 0.01, held)
    assert goal.position[0] > SAFE[0]


def test_the_goal_of_an_approach_lies_below_the_surface_and_the_last_part_is_slow(fake: FakeCell) -> None:
    fake.world.put("cube", 0.5, 0.0)
    goal, _ = make_approach(fake.cell, look(fake, "full")[0])
    assert goal.position == pytest.approx((0.5, 0.0, 0.035))
    assert goal.position[2] + goal.guarded_length == pytest.approx(0.05 + fake.cell.descent)
    assert goal.guarded_speed == fake.cell.descent_speed


def test_the_descent_is_fast_once_a_touch_confirmed_the_height_until_an_attempt_fails(fake: FakeCell) -> None:
    for y in (-0.1, 0.1):
        fake.world.put("cube", 0.5, y)
    first, second = look(fake, "full")
    assert make_approach(fake.cell, second)[0].fast_length == 0.0
    run_skill(Approach(target=first), fake)
    goal, _ = make_approach(fake.cell, second)
    assert goal.fast_length == pytest.approx(fake.cell.descent - fake.cell.slow_descent)
    assert goal.slow_length == pytest.approx(fake.cell.slow_descent + OVERTRAVEL)
    fake.cell.ledger.record_failed_pick(second.item)
    assert make_approach(fake.cell, second)[0].fast_length == 0.0


def test_an_approach_never_feels_below_the_middle_of_what_it_is_to_touch() -> None:
    washer = ObjectClass("washer", 0.006, 0.025, contact_radius=0.017)
    goal = make_object_goal(washer, np.array([0.5, 0.1, 0.013]), 0.02, 0.05)  # on another one
    assert goal.position == pytest.approx((0.517, 0.1, 0.013))
    assert (goal.guarded_length, goal.guarded_speed) == pytest.approx((0.003 + 0.02, 0.05))
    further = make_object_goal(
        washer, np.array([0.5, 0.1, 0.013]), 0.02, 0.05, failed_attempts=1, overtravel=0.001
    )
    assert further.position[2] == pytest.approx(0.015)
    assert np.hypot(further.position[0] - 0.5, further.position[1] - 0.1) == pytest.approx(0.017)


def test_what_goes_onto_a_layer_hangs_as_far_above_it_as_the_first_ones_above_the_floor(
    fake: FakeCell,
) -> None:
    box = fake.cell.bins["red_bin"]
    first, second = (
        make_slot_goal(box, number, 0.05, max_object_height=0.07) for number in (1, len(box.slots) + 1)
    )
    floor = float(box.position[2]) + BIN_THICKNESS
    assert first == Goal((*map(float, box.slots[1]), floor + 0.05 + DROP_HEIGHT))
    assert second.position == pytest.approx((*box.slots[1], floor + 0.07 + 0.05 + DROP_HEIGHT))
    assert make_slot_goal(box, 1, 0.05, 0.07, drop_height=0.03).position[2] == pytest.approx(
        floor + 0.05 + 0.03
    )
