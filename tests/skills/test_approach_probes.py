"""Approaches from the fourth attempt on, which search for contact almost down to the table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from executive.cell.objects import Target
from executive.cells.fake.cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.approach import Approach


def test_the_fourth_attempt_searches_for_an_object_almost_down_to_the_table(
    fake: FakeCell, look: Callable[..., list[Target]]
) -> None:
    fake.world.put("cube", 0.5, 0.0)
    (target,) = look()
    fake.world.objects.clear()
    messages = []
    for _ in range(4):
        current = replace(target, change_count=fake.ledger.change_count)
        messages.append(run_skill(Approach(target=current), fake).message)
    heights = [message.removeprefix("no contact down to ").split(" mm")[0] for message in messages]
    assert heights == ["35", "35", "35", "5"]
    assert [record.empty_probe_count for record in fake.ledger.records] == [1]


def test_a_probe_far_beside_the_middle_proves_nothing(
    fake: FakeCell, look: Callable[..., list[Target]]
) -> None:
    fake.world.put("duck", 0.5, 0.0)
    fake.world.put("sphere", 0.6, 0.1)
    _, target = look()
    fake.world.objects.clear()
    for offset, empty_probe_count in ((0.02, 0), (0.0025, 1)):
        for _ in range(3):
            fake.ledger.record_failed_pick(target.item)
        run_skill(
            Approach(target=replace(target, change_count=fake.ledger.change_count), offset=offset), fake
        )
        assert fake.ledger.records[1].empty_probe_count == empty_probe_count


@pytest.mark.parametrize(
    ("is_touched", "reason", "message"),
    [
        (False, "contradicted", "cube-1 may be no cube: it was touched 22 mm above the table, and a cube is"),
        (True, "no_contact", "the top of cube-1 was expected at 50 mm; it was touched 22 mm above the table"),
    ],
)
def test_a_touch_that_only_the_fourth_attempt_can_make_is_no_touch_of_the_target(
    fake: FakeCell, look: Callable[..., list[Target]], is_touched: bool, reason: str, message: str
) -> None:
    thing = fake.world.put("cube", 0.5, 0.0)
    for _ in range(3):
        (target,) = look()
    if is_touched:
        run_skill(Approach(target=target), fake)
    for _ in range(3):
        fake.ledger.record_failed_pick(target.item)
    thing.position[2] = -0.005
    result = run_skill(Approach(target=replace(target, change_count=fake.ledger.change_count)), fake)
    assert (result.reason, result.message[: len(message)]) == (reason, message)
    assert fake.ledger.describe(target.item).attempts == (4 if is_touched else 3)
