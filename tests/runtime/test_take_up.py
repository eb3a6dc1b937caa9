"""What a run does first when it is taken up again."""

from __future__ import annotations

import pytest
from at_hand import look

from executive.runtime.take_up import reconcile
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


def test_what_was_sealed_and_not_known_to_be_is_put_back_where_it_is(fake: FakeCell, item: str) -> None:
    fake.tool.close()
    reconcile(fake.cell, "close")
    assert (fake.tool.holding, fake.ledger.in_tool()) == (False, None)


def test_what_is_held_and_known_to_be_stays(fake: FakeCell, item: str) -> None:
    fake.tool.close()
    fake.ledger.held(item)
    reconcile(fake.cell, "close")
    assert (fake.tool.holding, fake.ledger.in_tool()) == (True, item)


def test_what_fell_from_the_tool_meanwhile_is_dropped(fake: FakeCell, item: str) -> None:
    fake.ledger.held(item)
    reconcile(fake.cell, "close")
    assert fake.ledger.in_tool() is None
    (row,) = fake.ledger.rows()
    assert (row["state"], row["attempts"]) == ("dropped", 1)


def test_what_the_run_itself_let_go_is_for_the_skill_to_say(fake: FakeCell, item: str) -> None:
    fake.ledger.held(item)
    reconcile(fake.cell, "open")
    assert fake.ledger.in_tool() == item


def test_everything_on_the_table_is_in_doubt(fake: FakeCell) -> None:
    fake.world.put("cube", 0.5, 0.0)
    (target,) = look(fake)
    assert fake.ledger.is_fresh(target)
    reconcile(fake.cell, "")
    assert not fake.ledger.is_fresh(target)
