"""What skills tell the arm of the cell, and what they do when it runs into something."""

from __future__ import annotations

import numpy as np
import pytest

from executive.arm import Goal, Task
from executive.goals import DROP, approach, into, onto, over
from executive.messages import BIN_THICKNESS, ObjectClass, Obstacle, Target
from executive.moving import carrying, heeding, planned
from executive.surroundings import around, slots_taken
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.approach import Approach
from skills.detect import Detect
from skills.grasp import Grasp
from skills.localize import Localize
from skills.move_to_scan import MoveToScan
from skills.release import Release
from skills.transit import Transit


@pytest.fixture
def targets(fake: FakeCell) -> list[Target]:
    """A cube and a duck on the fake table, seen once."""
    fake.world.put("cube", 0.5, 0.0)
    fake.world.put("duck", 0.6, 0.15)
    return look(fake)


def look(fake: FakeCell) -> list[Target]:
    detections = run_skill(Detect(), fake).outputs["detections"]
    return run_skill(Localize(detections=detections), fake).outputs["targets"]


def pick(fake: FakeCell, target: Target) -> None:
    run_skill(Approach(target=target), fake)
    run_skill(Grasp(target=target), fake)


def names(fake: FakeCell, but: str | None = None) -> list[str]:
    return [obstacle.name for obstacle in around(fake.cell, but)]


def test_what_stands_on_the_table_is_in_the_way_but_for_what_is_to_be_touched(
    fake: FakeCell, targets: list[Target]
) -> None:
    assert names(fake) == ["cube-1", "duck-1"]
    _, task = approach(fake.cell, targets[0])
    (duck,) = task.around
    kind = fake.cell.classes["duck"]
    assert (duck.name, duck.radius) == ("duck-1", kind.radius)
    assert (duck.x, duck.y, duck.top) == pytest.approx((0.6, 0.15, kind.height))


def test_what_is_to_be_touched_is_named_as_it_stands_there(fake: FakeCell, targets: list[Target]) -> None:
    _, task = approach(fake.cell, targets[0])
    assert task.target == next(thing for thing in around(fake.cell) if thing.name == "cube-1")
    assert heeding(fake.cell).target is None
    pick(fake, targets[0])
    assert carrying(fake.cell, "cube-1").target is None


def test_a_rejected_item_stands_there_still(fake: FakeCell, targets: list[Target]) -> None:
    fake.ledger.rejected("duck-1", "slippery")
    assert "duck-1" in names(fake)


def test_what_is_carried_is_the_load_and_in_nobodys_way(fake: FakeCell, targets: list[Target]) -> None:
    assert heeding(fake.cell).load is None
    pick(fake, targets[0])
    task = heeding(fake.cell)
    assert task == carrying(fake.cell, "cube-1")
    assert task.load is not None
    assert (task.load.kind.label, task.load.bears) == ("cube", 7.9)
    assert [obstacle.name for obstacle in task.around] == ["duck-1"]
    fake.tool.strength = 3.0
    assert heeding(fake.cell).load.bears == 3.0  # type: ignore[union-attr]


def test_what_lies_in_a_bin_is_in_the_way_as_high_as_it_is_piled(fake: FakeCell) -> None:
    box = fake.cell.bins["red_bin"]
    height = max(kind.height for kind in fake.cell.classes.values())  # anything may lie there
    for number in range(len(box.slots) + 1):
        fake.world.put("cube", 0.5, 0.0)
        (target,) = look(fake)
        pick(fake, target)
        assert len(around(fake.cell, target.item)) == min(number, len(box.slots)), "itself left out"
        run_skill(Transit(held=target.item, bin="red_bin"), fake)
        run_skill(Release(held=target.item, bin="red_bin"), fake)
    tops = {(obstacle.x, obstacle.y): obstacle.top for obstacle in around(fake.cell)}
    assert [tops[(x, y)] for x, y in box.slots] == pytest.approx(
        [BIN_THICKNESS + 2 * height, *[BIN_THICKNESS + height] * (len(box.slots) - 1)]
    )


def test_what_hangs_over_a_bin_counts_as_let_go_there_but_for_its_own_way(
    fake: FakeCell, targets: list[Target]
) -> None:
    pick(fake, targets[0])
    assert slots_taken(fake.cell, "red_bin") == 0, "it hangs over the table"
    run_skill(Transit(held="cube-1", bin="red_bin"), fake)
    first, second = fake.cell.bins["red_bin"].slots[:2]
    assert (slots_taken(fake.cell, "red_bin"), slots_taken(fake.cell, "blue_bin")) == (1, 0)
    assert slots_taken(fake.cell, "red_bin", "cube-1") == 0
    assert np.allclose(into(fake.cell, "red_bin", "cube-1").position[:2], first)
    assert np.allclose(into(fake.cell, "red_bin", "duck-1").position[:2], second)
    before = around(fake.cell)
    run_skill(Release(held="cube-1", bin="red_bin"), fake)
    assert around(fake.cell) == before
    assert slots_taken(fake.cell, "red_bin") == 1


def test_the_goal_of_an_approach_lies_below_the_surface_and_the_last_part_is_slow(
    fake: FakeCell, targets: list[Target]
) -> None:
    goal, _ = approach(fake.cell, targets[0])
    assert goal.position == pytest.approx((0.5, 0.0, 0.035))
    assert goal.position[2] + goal.guarded == pytest.approx(0.05 + fake.cell.descent)
    assert goal.speed == fake.cell.descent_speed


def test_an_approach_never_feels_below_the_middle_of_what_it_is_to_touch() -> None:
    washer = ObjectClass("washer", 0.006, 0.025, ring=0.017)
    goal = onto(washer, np.array([0.5, 0.1, 0.013]), 0.02, 0.05)  # on another one
    assert goal.position == pytest.approx((0.517, 0.1, 0.013))
    assert (goal.guarded, goal.speed) == pytest.approx((0.003 + 0.02, 0.05))
    further = onto(washer, np.array([0.5, 0.1, 0.013]), 0.02, 0.05, attempt=1, overtravel=0.001)
    assert further.position[2] == pytest.approx(0.015)
    assert np.hypot(further.position[0] - 0.5, further.position[1] - 0.1) == pytest.approx(0.017)


def test_what_goes_onto_a_layer_hangs_as_far_above_it_as_the_first_ones_above_the_floor(
    fake: FakeCell,
) -> None:
    box = fake.cell.bins["red_bin"]
    first, second = (over(box, number, 0.05, tallest=0.07) for number in (1, len(box.slots) + 1))
    floor = float(box.position[2]) + BIN_THICKNESS
    assert first == Goal((*map(float, box.slots[1]), floor + 0.05 + DROP))
    assert second.position == pytest.approx((*box.slots[1], floor + 0.07 + 0.05 + DROP))
    assert over(box, 1, 0.05, 0.07, drop=0.03).position[2] == pytest.approx(floor + 0.05 + 0.03)


def test_an_arm_that_runs_into_something_stops_and_the_whole_table_is_in_doubt(
    fake: FakeCell, targets: list[Target]
) -> None:
    fake.arm.runs_into = "link 4 ran into the lamp"
    result = run_skill(MoveToScan(pose="aside"), fake)
    assert (result.reason, result.message) == ("blocked", "link 4 ran into the lamp")
    assert fake.arm.at_rest
    assert not any(fake.ledger.is_fresh(target) for target in targets)
    assert run_skill(MoveToScan(pose="aside"), fake).status == "SUCCESS", "only that motion was broken off"


def test_what_a_look_shows_while_a_motion_is_planned_is_heeded(fake: FakeCell) -> None:
    asked: list[Task] = []

    def ask() -> tuple[Goal, Task]:
        stands = (Obstacle(0.5, 0.1, 0.03, 0.05, "cube-9"),) if len(asked) > 0 else ()
        asked.append(Task(around=stands))
        return Goal((0.5, -0.1, 0.1)), asked[-1]

    steps = planned(MoveToScan(), fake.cell.arm, ask)
    ticks = 0
    with pytest.raises(StopIteration):
        while True:
            next(steps)
            fake.advance()
            ticks += 1
    assert len(asked) == 4, "planned, and found changed; planned anew, and found the same"
    assert ticks == pytest.approx(2 * 0.05 * 240, abs=2)
