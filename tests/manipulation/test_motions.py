"""What skills do with the arm: planning, following, and what they do when it runs into something."""

from __future__ import annotations

import pytest

from executive.cell.arm import Goal, Task
from executive.cell.objects import Obstacle, Target
from executive.cells.fake.cell import FakeCell
from executive.manipulation.motions import plan
from executive.manipulation.tool_goals import list_obstacles
from executive.testing.run_skill import run_skill
from skills.move_to_scan import MoveToScan


def test_an_arm_that_runs_into_something_stops_and_the_whole_table_is_in_doubt(
    fake: FakeCell, targets: list[Target]
) -> None:
    fake.arm.next_obstacle = "link 4 ran into the lamp"
    result = run_skill(MoveToScan(pose="aside"), fake)
    assert (result.reason, result.message) == ("blocked", "link 4 ran into the lamp")
    assert fake.arm.at_rest
    assert not any(fake.ledger.is_fresh(target) for target in targets)
    point = fake.arm.contact_point
    assert point is not None
    assert (point[0], point[1]) in [(obstacle.x, obstacle.y) for obstacle in list_obstacles(fake.cell)]
    assert run_skill(MoveToScan(pose="aside"), fake).status == "SUCCESS", "only that motion was broken off"


def test_a_look_during_planning_changes_the_plan(fake: FakeCell) -> None:
    asked: list[Task] = []

    def ask() -> tuple[Goal, Task]:
        stands = (Obstacle(0.5, 0.1, 0.03, 0.05, "cube-9"),) if len(asked) > 0 else ()
        asked.append(Task(obstacles=stands))
        return Goal((0.5, -0.1, 0.1)), asked[-1]

    steps = plan(MoveToScan(), fake.cell.arm, ask)
    ticks = 0
    with pytest.raises(StopIteration):
        while True:
            next(steps)
            fake.advance()
            ticks += 1
    assert len(asked) == 4, "planned, and found changed; planned anew, and found the same"
    assert ticks == pytest.approx(2 * 0.1 * 240, abs=2)
