"""What a run does first when it is taken up again."""

from __future__ import annotations

import pytest
from at_hand import look

from executive.run.replay import reconcile_ledger
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.approach import Approach


@pytest.fixture
def item(fake: FakeCell) -> str:
    """An object that the cup is on."""
    fake.world.put("cube", 0.5, 0.0)
    (target,) = look(fake)
    run_skill(Approach(target=target), fake)
    return str(target.item)


@pytest.mark.parametrize(
    ("sealed", "known", "intent", "left"),
    [
        (True, False, "close", (False, False, "seen")),
        (True, True, "close", (True, True, "held")),
        (False, True, "close", (False, False, "dropped")),
        # What the run itself let go is for the skill to say.
        (False, True, "open", (False, True, "held")),
    ],
)
def test_tool_and_ledger_agree_afterwards(
    fake: FakeCell, item: str, sealed: bool, known: bool, intent: str, left: tuple[bool, bool, str]
) -> None:
    if sealed:
        fake.tool.close()
    if known:
        fake.ledger.record_grasp(item)
    reconcile_ledger(fake.cell, intent)
    (row,) = fake.ledger.list_items()
    assert (fake.tool.holding, fake.ledger.find_held_item() == item, row.state) == left
    assert row.attempts == (row.state == "dropped")


def test_everything_on_the_table_is_in_doubt(fake: FakeCell) -> None:
    fake.world.put("cube", 0.5, 0.0)
    (target,) = look(fake)
    assert fake.ledger.is_fresh(target)
    reconcile_ledger(fake.cell, "")
    assert not fake.ledger.is_fresh(target)
