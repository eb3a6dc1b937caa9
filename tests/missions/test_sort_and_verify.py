"""Someone takes a sorted object out of its bin, and the mission notices, finds it, and sorts it again."""

from __future__ import annotations

from executive.events import ItemChanged
from executive.testing.fake_cell import FakeCell
from executive.testing.faults import during, object_moved
from executive.testing.run_mission import MissionResult, run_mission

VERIFY = "*for_each*/LookAt"
FROM_RED_BIN_TO_TABLE = (0.29, 0.40)
"""Displacement from a slot of the red bin onto the table [m]."""


def put_cube(fake: FakeCell) -> None:
    """Leave one cube on the table."""
    for thing in [*fake.world.objects]:
        fake.world.objects.remove(thing)
    fake.world.put("cube", 0.45, -0.15)


def list_states(result: MissionResult, item: str) -> list[str]:
    """Return the successive states of an item."""
    states = [timed.event.state for timed in result.events if isinstance(timed.event, ItemChanged)
              and timed.event.item == item]  # fmt: skip
    return [state for index, state in enumerate(states) if states[index - 1 : index] != [state]]


def test_an_object_that_is_put_back_on_the_table_is_sorted_again_under_its_name() -> None:
    fault = during(VERIFY, object_moved(FROM_RED_BIN_TO_TABLE, 1), activations=1)
    result = run_mission("sort_and_verify", faults=[fault], arrange=put_cube)
    assert (result.status, result.agrees) == ("SUCCESS", True)
    assert "gone" in result.list_failure_reasons(VERIFY)
    assert list_states(result, "cube-1") == ["seen", "held", "placed", "dropped", "seen", "held", "placed"]
    assert (result.items["placed"], result.items["seen"]) == (1, 1)
