"""What stands in the cell, as skills tell the arm of it."""

from __future__ import annotations

import numpy as np
import pytest
from at_hand import look, pick

from executive.cell.bins import BIN_THICKNESS
from executive.cell.objects import Target
from executive.cells.fake.cell import FakeCell
from executive.manipulation.motions import make_task, make_transport_task
from executive.manipulation.tool_goals import (
    list_obstacles,
    make_approach,
    make_bin_goal,
    predict_object_count,
)
from executive.testing.run_skill import run_skill
from skills.release import Release
from skills.transit import Transit


def names(fake: FakeCell, but: str | None = None) -> list[str]:
    return [obstacle.name for obstacle in list_obstacles(fake.cell, but)]


def test_what_stands_on_the_table_is_in_the_way_but_for_what_is_to_be_touched(
    fake: FakeCell, targets: list[Target]
) -> None:
    assert names(fake) == ["cube-1", "duck-1"]
    _, task = make_approach(fake.cell, targets[0])
    (duck,) = task.obstacles
    kind = fake.cell.classes["duck"]
    assert (duck.name, duck.radius) == ("duck-1", kind.radius)
    assert (duck.x, duck.y, duck.top) == pytest.approx((0.6, 0.15, kind.height))


def test_what_is_to_be_touched_is_named_as_it_stands_there(fake: FakeCell, targets: list[Target]) -> None:
    _, task = make_approach(fake.cell, targets[0])
    assert task.target == next(thing for thing in list_obstacles(fake.cell) if thing.name == "cube-1")
    assert make_task(fake.cell).target is None
    pick(fake, targets[0])
    assert make_transport_task(fake.cell, "cube-1").target is None


def test_a_rejected_item_stands_there_still(fake: FakeCell, targets: list[Target]) -> None:
    fake.ledger.reject("duck-1", "slippery")
    assert "duck-1" in names(fake)


def test_what_is_carried_is_the_load_and_in_nobodys_way(fake: FakeCell, targets: list[Target]) -> None:
    assert make_task(fake.cell).load is None
    pick(fake, targets[0])
    task = make_task(fake.cell)
    assert task == make_transport_task(fake.cell, "cube-1")
    assert task.load is not None
    assert (task.load.object_class.label, task.load.holding_force) == ("cube", 7.9)
    assert [obstacle.name for obstacle in task.obstacles] == ["duck-1"]
    fake.tool.breakaway_force = 3.0
    assert make_task(fake.cell).load.holding_force == 3.0  # type: ignore[union-attr]


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
    assert np.allclose(make_bin_goal(fake.cell, "red_bin", "cube-1").position[:2], first)
    assert np.allclose(make_bin_goal(fake.cell, "red_bin", "duck-1").position[:2], second)
    before = list_obstacles(fake.cell)
    run_skill(Release(held="cube-1", bin="red_bin"), fake)
    assert list_obstacles(fake.cell) == before
    assert predict_object_count(fake.cell, "red_bin") == 1
