"""Putting down what is held, and losing it on the way."""

from __future__ import annotations

from collections.abc import Callable
from unittest.mock import Mock

import pytest
from at_hand import intercept

from executive.errors import Blocked, Unreachable
from executive.skill import SkillFailed
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.put_down import PutDown


def lost(fake: FakeCell, held: str, when: Callable[[], bool]) -> SkillFailed:
    """Return how a PutDown fails whose seal breaks as soon as `when` holds."""
    steps = PutDown(held=held).run(fake.cell)
    with pytest.raises(SkillFailed) as failure:
        while True:
            next(steps)
            fake.advance()
            if when():
                fake.tool.open()
    return failure.value


def test_it_is_let_go_where_it_touches_the_safe_place_and_the_next_look_finds_it(
    fake: FakeCell, held: str, look
) -> None:
    assert run_skill(PutDown(held=held), fake).status == "SUCCESS"
    # The motion would end 3 mm below; the arm moves 0.15 mm in a step.
    assert fake.arm.tool_pose.position == pytest.approx([*fake.cell.safe_place[:2], 0.05], abs=2e-4)
    assert (fake.tool.holding, fake.ledger.find_held_item()) == (False, None)
    assert [target.item for target in look("full")] == [held]


def test_what_falls_on_the_way_is_dropped_where_the_arm_stops(fake: FakeCell, held: str) -> None:
    failure = lost(fake, held, lambda: fake.arm.tool_pose.position[1] < -0.1)
    assert failure.reason == "dropped"
    assert "the seal on cube-1 broke on the way to the safe place, near (" in failure.message
    assert fake.arm.at_rest
    assert fake.arm.tool_pose.position[1] == pytest.approx(-0.1, abs=0.01)
    known = fake.ledger.describe(held)
    assert (fake.ledger.find_held_item(), known.attempts, known.state) == (None, 1, "lost")


def test_what_falls_while_the_way_is_planned_is_dropped_though_there_is_none(
    fake: FakeCell, held: str, nowhere: Callable[[Exception], None]
) -> None:
    nowhere(Unreachable("too far"))
    assert run_skill(PutDown(held=held), fake).reason == "unreachable"
    assert lost(fake, held, lambda: True).reason == "dropped"
    assert fake.ledger.find_held_item() is None


@pytest.fixture
def nowhere(fake: FakeCell) -> Callable[[Exception], None]:
    """Makes every plan from now on end with an error."""
    return lambda error: intercept(fake, "plan.result", Mock(side_effect=error))


def test_what_cannot_be_carried_away_and_was_not_lifted_is_left_where_it_stood(
    fake: FakeCell, held: str, nowhere: Callable[[Exception], None]
) -> None:
    nowhere(Blocked("bolt-2 is too near"))
    result = run_skill(PutDown(held=held), fake)
    assert (result.status, fake.tool.holding, fake.ledger.find_held_item()) == ("SUCCESS", False, None)
    (row,) = fake.ledger.list_items()
    assert (row.state, row.position[:2]) == ("seen", pytest.approx([0.5, 0.0], abs=1e-3))


def test_what_hangs_in_the_air_and_cannot_be_carried_on_is_not_let_fall(fake: FakeCell, held: str) -> None:
    steps = PutDown(held=held).run(fake.cell)
    with pytest.raises(SkillFailed) as failure:
        while True:
            next(steps)
            fake.advance()
            if fake.arm.tool_pose.position[2] > 0.1:
                fake.arm.stop_after_collision("a hand")
    assert (failure.value.reason, fake.tool.holding) == ("blocked", True)
