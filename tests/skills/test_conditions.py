"""Conditions, the confirmation of a grasp, and waiting."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from executive.cell.objects import Target
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.conditions import IsFresh, IsHolding, IsPlaced, IsReachable
from skills.confirm_grasp import ConfirmGrasp
from skills.wait import Wait


def test_an_item_in_the_tool_is_held(fake: FakeCell, held: str) -> None:
    result = run_skill(IsHolding(), fake)
    assert (result.status, result.outputs, result.commands) == ("SUCCESS", {}, [])


def test_a_lost_item_stays_in_the_ledger(fake: FakeCell, held: str) -> None:
    fake.tool.open()
    result = run_skill(IsHolding(), fake)
    assert (result.reason, result.message[-18:]) == ("empty", f"{held} in the tool")
    assert (result.commands, fake.ledger.find_held_item()) == ([], held)
    fake.ledger.record_drop(held)
    assert run_skill(IsHolding(), fake).message == "the sensor detects no seal"


def test_an_unknown_object_in_the_tool_is_not_released(fake: FakeCell, held: str) -> None:
    fake.ledger.record_drop(held)
    assert (run_skill(IsHolding(), fake).reason, fake.tool.holding) == ("empty", True)


def test_a_target_is_fresh_until_the_robot_may_have_moved_it(fake: FakeCell, target: Target) -> None:
    assert run_skill(IsFresh(target=target), fake).status == "SUCCESS"
    fake.ledger.invalidate_positions()
    assert run_skill(IsFresh(target=target), fake).reason == "stale"


def test_a_target_beyond_the_arm_is_unreachable(fake: FakeCell, target: Target) -> None:
    assert run_skill(IsReachable(target=target), fake).status == "SUCCESS"
    far = replace(target, position=np.array([2.0, 0.0, 0.025]))
    result = run_skill(IsReachable(target=far), fake)
    assert (result.reason, result.message[:8]) == ("unreachable", "cube-1: ")


def test_an_item_is_placed_when_it_is_in_a_bin(fake: FakeCell, held: str) -> None:
    assert run_skill(IsPlaced(item=held), fake).reason == "not_placed"
    fake.ledger.record_placement(held, "red_bin")
    assert run_skill(IsPlaced(item=held), fake).status == "SUCCESS"


def test_it_names_what_the_tool_holds(fake: FakeCell, held: str) -> None:
    result = run_skill(ConfirmGrasp(), fake)
    assert (result.status, result.outputs) == ("SUCCESS", {"held": held})


def test_an_object_that_the_ledger_does_not_know_is_released(fake: FakeCell, held: str) -> None:
    fake.ledger.record_drop(held)
    count = fake.ledger.change_count
    result = run_skill(ConfirmGrasp(), fake)
    assert (result.status, result.reason, fake.tool.holding) == ("FAILURE", "empty", False)
    assert "a seal, but the ledger knows no held item" in result.message
    assert fake.ledger.change_count == count + 1, "the object may fall on others"
    assert run_skill(ConfirmGrasp(), fake).message == "the sensor detects no seal"
    assert fake.ledger.change_count == count + 1


def test_what_should_be_in_the_tool_and_is_not_was_dropped(fake: FakeCell, held: str) -> None:
    fake.tool.open()
    assert run_skill(ConfirmGrasp(), fake).message == f"the sensor detects no seal; {held} was dropped"
    known = fake.ledger.describe(held)
    assert (fake.ledger.find_held_item(), known.state, known.attempts) == (None, "lost", 1)


def test_waiting_takes_its_time_on_the_runs_clock_and_moves_nothing(fake: FakeCell) -> None:
    assert run_skill(Wait(seconds=2.5), fake).status == "SUCCESS"
    assert (fake.cell.clock.now, fake.arm.commands) == (pytest.approx(2.5, abs=1 / 240), [])
