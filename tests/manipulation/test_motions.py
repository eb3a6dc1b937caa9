"""What skills do with the arm: planning, following, and the detection of drops."""

from __future__ import annotations

import numpy as np
import pytest
from at_hand import pick

from executive.cell.arm import Goal, Task
from executive.cell.objects import Obstacle, Target
from executive.geometry import GRAVITY
from executive.manipulation.motions import (
    MAX_PREDICTABLE_SPEED,
    detect_and_record_drop,
    plan,
    predict_landing,
)
from executive.manipulation.tool_goals import list_obstacles
from executive.station.planner_service import PlannedArm
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.move_to_scan import MoveToScan
from skills.transit import Transit


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


@pytest.mark.parametrize("up", [-0.5, 0.0, 0.5])
def test_its_flight_begins_with_the_velocity_of_the_tool(up: float) -> None:
    place = np.array((0.0, 0.0, 0.4))
    velocity = np.array((0.3, -0.2, up))
    height = 0.06
    underside = place - np.array((0.0, 0.0, height))
    x, y, z = predict_landing(underside, velocity, height)
    time = x / 0.3
    assert y == pytest.approx(-0.2 * time)
    assert 0.4 + up * time - GRAVITY * time**2 / 2 == pytest.approx(height)
    assert z == height / 2


def test_what_touches_the_ground_already_stays_where_it_is() -> None:
    assert np.allclose(
        predict_landing(np.array((0.4, 0.1, -0.01)), np.array((1.0, 0, 0)), 0.05)[:2], (0.4, 0.1)
    )


def test_a_drop_is_recorded_once(fake: FakeCell, target: Target) -> None:
    held = pick(fake, target)
    assert not detect_and_record_drop(fake.cell, held)
    fake.tool.lose_grip()
    assert detect_and_record_drop(fake.cell, held)
    assert detect_and_record_drop(fake.cell, held)
    (row,) = fake.ledger.list_items()
    assert (row.state, row.attempts) == ("dropped", 1)


@pytest.mark.parametrize(
    ("speed", "state"),
    [(0.0, "placed"), (MAX_PREDICTABLE_SPEED - 0.01, "placed"), (MAX_PREDICTABLE_SPEED + 0.01, "lost")],
)
def test_what_slips_away_over_its_bin_is_believed_there_unless_it_was_thrown(
    fake: FakeCell, target: Target, monkeypatch: pytest.MonkeyPatch, speed: float, state: str
) -> None:
    held = pick(fake, target)
    run_skill(Transit(held=held, bin="red_bin"), fake)
    monkeypatch.setattr(PlannedArm, "tool_velocity", np.array((0.0, speed, 0.0)))
    fake.tool.lose_grip()
    assert detect_and_record_drop(fake.cell, held)
    fake.ledger.set_final_states(completed=True)
    assert [row.state for row in fake.ledger.list_items()] == [state]
