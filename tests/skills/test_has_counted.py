from __future__ import annotations

from typing import Any

import pytest

from executive.cells.fake.cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.conditions import HasCounted


@pytest.fixture
def counted(fake: FakeCell, look: Any) -> FakeCell:
    """A cell with two placed cubes in different bins, a placed duck and a rejected sphere."""
    for index, label in enumerate(["cube", "cube", "duck", "sphere"]):
        fake.world.put(label, 0.45 + 0.12 * (index % 2), 0.15 * (index // 2))
    items = {target.item for target in look()}
    assert items == {"cube-1", "cube-2", "duck-1", "sphere-1"}
    for item, bin in {"cube-1": "red_bin", "cube-2": "blue_bin", "duck-1": "red_bin"}.items():
        fake.ledger.record_placement(item, bin)
    fake.ledger.reject("sphere-1", "it slips")
    return fake


@pytest.mark.parametrize(
    ("values", "count"),
    [
        ({}, 3),
        ({"of_class": "cube"}, 2),
        ({"inside": "red_bin"}, 2),
        ({"of_class": "cube", "inside": "red_bin"}, 1),
        ({"of_class": "sphere", "counter": "rejected"}, 1),
        ({"of_class": "cube", "counter": "rejected"}, 0),
    ],
)
def test_it_succeeds_up_to_the_number_of_counted_items(counted: FakeCell, values: Any, count: int) -> None:
    results = [run_skill(HasCounted(at_least=number, **values), counted) for number in range(1, 5)]
    assert [result.reason for result in results] == [""] * count + ["too_few"] * (4 - count)


def test_the_failure_states_what_was_counted(counted: FakeCell) -> None:
    result = run_skill(HasCounted(at_least=2, of_class="cube", inside="red_bin"), counted)
    assert result.message == "1 of 2 required items of class cube are placed in red_bin"


def test_a_rejected_item_that_left_its_place_counts_as_rejected(counted: FakeCell) -> None:
    counted.ledger.record_grasp("sphere-1")
    counted.ledger.record_drop("sphere-1")
    assert counted.ledger.describe("sphere-1").state == "rejected"
    assert run_skill(HasCounted(at_least=1, counter="rejected"), counted).reason == ""
