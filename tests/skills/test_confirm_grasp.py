"""ConfirmGrasp: the sensor decides."""

from __future__ import annotations

from executive.cells.fake.cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.confirm_grasp import ConfirmGrasp


def test_it_names_what_the_tool_holds(fake: FakeCell, held: str) -> None:
    result = run_skill(ConfirmGrasp(), fake)
    assert (result.status, result.outputs) == ("SUCCESS", {"held": held})


def test_an_empty_tool_is_a_failure(fake: FakeCell) -> None:
    result = run_skill(ConfirmGrasp(), fake)
    assert (result.status, result.reason) == ("FAILURE", "empty")
    assert result.message == "the sensor detects no seal"


def test_an_object_that_the_ledger_does_not_know_is_released(fake: FakeCell, held: str) -> None:
    fake.ledger.record_drop(held)
    result = run_skill(ConfirmGrasp(), fake)
    assert (result.status, result.reason, fake.tool.holding) == ("FAILURE", "empty", False)
    assert (
        result.message == "the sensor detects a seal, but the ledger knows no held item; the tool was opened"
    )


def test_what_should_be_in_the_tool_and_is_not_was_dropped(fake: FakeCell, held: str) -> None:
    fake.tool.open()
    assert run_skill(ConfirmGrasp(), fake).message == f"the sensor detects no seal; {held} was dropped"
    known = fake.ledger.describe(held)
    assert (fake.ledger.find_held_item(), known.state, known.attempts) == (None, "lost", 1)


def test_an_object_that_the_ledger_does_not_know_may_fall_on_others(fake: FakeCell, held: str) -> None:
    fake.ledger.record_drop(held)
    count = fake.ledger.change_count
    run_skill(ConfirmGrasp(), fake)
    assert fake.ledger.change_count == count + 1
