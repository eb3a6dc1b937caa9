"""Conditions: each succeeds or fails in one tick, and changes nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from executive.cell.objects import Target
from executive.cells.fake.cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.has_elapsed import HasElapsed
from skills.is_fresh import IsFresh
from skills.is_holding import IsHolding
from skills.is_placed import IsPlaced
from skills.is_reachable import IsReachable


def test_an_item_in_the_tool_is_held(fake: FakeCell, held: str) -> None:
    result = run_skill(IsHolding(), fake)
    assert (result.status, result.outputs, result.commands) == ("SUCCESS", {}, [])


def test_an_empty_tool_is_not_holding(fake: FakeCell) -> None:
    result = run_skill(IsHolding(), fake)
    assert (result.status, result.reason) == ("FAILURE", "empty")
    assert result.message == "the sensor detects no seal"


def test_a_lost_item_stays_in_the_ledger(fake: FakeCell, held: str) -> None:
    fake.tool.open()
    result = run_skill(IsHolding(), fake)
    assert result.message == f"the sensor detects no seal, but the ledger reports {held} in the tool"
    assert (result.commands, fake.ledger.find_held_item()) == ([], held)


def test_an_unknown_object_in_the_tool_is_not_released(fake: FakeCell, held: str) -> None:
    fake.ledger.record_drop(held)
    assert run_skill(IsHolding(), fake).reason == "empty"
    assert fake.tool.holding


def test_a_target_is_fresh_until_the_robot_may_have_moved_it(fake: FakeCell, target: Target) -> None:
    assert run_skill(IsFresh(target=target), fake).status == "SUCCESS"
    fake.ledger.invalidate_positions()
    assert run_skill(IsFresh(target=target), fake).reason == "stale"


def test_a_target_beyond_the_arm_is_unreachable(fake: FakeCell, target: Target) -> None:
    assert run_skill(IsReachable(target=target), fake).status == "SUCCESS"
    far = replace(target, position=np.array([2.0, 0.0, 0.025]))
    result = run_skill(IsReachable(target=far), fake)
    assert (result.reason, result.message[:16]) == ("unreachable", "cube-1: the tool")


def test_an_item_is_placed_when_it_is_in_a_bin(fake: FakeCell, held: str) -> None:
    assert run_skill(IsPlaced(item=held), fake).reason == "not_placed"
    fake.ledger.record_placement(held, "red_bin")
    assert run_skill(IsPlaced(item=held), fake).status == "SUCCESS"


def test_a_time_has_elapsed_once_the_clock_reaches_it(fake: FakeCell) -> None:
    condition = HasElapsed(seconds=fake.cell.clock.now + 2 * fake.cell.clock.step)
    assert run_skill(condition, fake).reason == "too_early"
    fake.advance()
    fake.advance()
    assert run_skill(condition, fake).status == "SUCCESS"
