"""Order of the targets by the travel between bins and targets."""

from __future__ import annotations

import pytest
from at_hand import look

from executive.cell.arm import Goal
from executive.cells.fake.cell import FakeCell
from executive.manipulation.tool_goals import sort_by_tour, sort_pickable_targets


@pytest.mark.parametrize(("y", "first"), [(0.05, "duck-1"), (0.2, "cube-1")])
def test_the_shortest_tour_may_begin_with_a_farther_target(fake: FakeCell, y: float, first: str) -> None:
    """The red bin of the cube is far from the duck; the yellow bin of the duck is nearer to the cube.

    From y = 0.05 m, the tours measure 0.57 m and 0.46 m; from the position of the cube, 0.42 m and 0.61 m.
    """
    fake.world.put("cube", 0.5, 0.2)
    fake.world.put("duck", 0.5, -0.15)
    targets = look(fake, "full")
    fake.arm.start(fake.arm.plan(Goal((0.5, y, 0.3))).result())
    assert [target.item for target in sort_pickable_targets(fake.cell, targets)] == ["cube-1", "duck-1"]
    assert sort_by_tour(fake.cell, targets)[0].item == first


def test_one_target_or_none_needs_no_tour(fake: FakeCell) -> None:
    assert sort_by_tour(fake.cell, []) == []
    fake.world.put("cube", 0.5, 0.0)
    targets = look(fake, "full")
    assert sort_by_tour(fake.cell, targets) == targets
