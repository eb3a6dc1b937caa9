"""Shipped missions that weigh objects or stop at the end of a working time."""

from __future__ import annotations

import pytest

from executive.drivers.fake import FakeTool
from executive.testing.fake_cell import FakeCell
from executive.testing.faults import during, grip_lost
from executive.testing.run_mission import run_mission


def put_objects(fake: FakeCell) -> None:
    """Leave three objects on the table."""
    fake.world.objects.clear()
    for label, y in (("sphere", -0.2), ("cube", 0.1), ("cube", 0.2)):
        fake.world.put(label, 0.5, y)


@pytest.mark.parametrize("skill", ["Weigh", pytest.param("Transit", marks=pytest.mark.slow)])
def test_a_dropped_object_does_not_end_the_sort_by_weight(skill: str) -> None:
    faults = [during(f"*/{skill}", grip_lost(), activations=1)]
    result = run_mission("weigh_and_sort", faults=faults, arrange=put_objects)
    assert result.list_failure_reasons(f"*/{skill}") == ["dropped"]
    assert (result.status, result.items["placed"], result.agrees) == ("SUCCESS", 3, True)


def test_a_broken_load_cell_leaves_all_objects_on_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FakeTool, "load", 0.0)
    result = run_mission("weigh_and_sort", arrange=put_objects)
    assert (result.status, result.items["rejected"], result.agrees) == ("INCOMPLETE", 3, True)
    assert "the load cell is broken" in result.message


def test_after_the_working_time_the_held_object_is_put_down_and_no_other_is_picked() -> None:
    result = run_mission("sort_guarded", set={"limit": "3"}, arrange=put_objects)
    assert len(result.list_activated_nodes("*/Grasp")) == result.items["placed"] + 1
    assert len(result.list_activated_nodes("*/PutDown")) == 1
    reasons = {row.reason for row in result.ledger.list_items()}
    assert not any(reason.startswith("could not be picked") for reason in reasons)
