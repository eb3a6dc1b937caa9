"""The missions that put an object back, follow an order, and ask for classes."""

from __future__ import annotations

import numpy as np

from executive.cell.protocols import Cell, Steps
from executive.events import ItemChanged, NodeEnded
from executive.testing.fake_cell import FakeCell
from executive.testing.faults import during, grip_fails
from executive.testing.run_mission import MissionResult, run_mission
from skills.approach import Approach

MAX_NEIGHBOUR_DISTANCE = 0.09
"""Distance below which two neighbours prevent an approach to the object between them [m]."""


def list_placed(result: MissionResult) -> list[str]:
    """Return the items in the order of their placement."""
    changes = [timed.event for timed in result.events if isinstance(timed.event, ItemChanged)]
    return list(dict.fromkeys(change.item for change in changes if change.state == "placed"))


def put(cell: FakeCell, *places: tuple[str, float, float]) -> None:
    cell.world.objects.clear()
    for place in places:
        cell.world.put(*place)


def put_a_row(cell: FakeCell) -> None:
    put(cell, ("cube", 0.45, 0.0), ("sphere", 0.45, 0.08), ("duck", 0.45, -0.08))


def test_a_missed_object_comes_last_and_is_then_picked() -> None:
    misses = during("*/Grasp", grip_fails(), activations=[1, 2])
    result = run_mission("sort_with_second_chance", arrange=put_a_row, faults=[misses])
    assert (result.status, result.items["placed"], result.agrees) == ("SUCCESS", 3, True)
    ends = [timed.event for timed in result.events if isinstance(timed.event, NodeEnded)]
    assert [end.item for end in ends if end.skill == "Defer"] == list_placed(result)[-1:]


def test_an_object_that_is_missed_again_at_the_end_is_rejected() -> None:
    misses = during("*/Grasp", grip_fails(), activations=[1, 2, 5, 6])
    result = run_mission("sort_with_second_chance", arrange=put_a_row, faults=[misses])
    assert (result.status, result.items["placed"], result.items["rejected"]) == ("INCOMPLETE", 2, 1)
    assert result.list_failure_reasons("*/Defer") == ["exhausted"]


class CarefulApproach(Approach):
    """Approach that is blocked while two objects are too near to the target."""

    def run(self, cell: Cell) -> Steps:
        """Count the neighbours, then approach."""
        targets = (entry for entry in cell.ledger.find_objects_on_table() if entry.item != self.target.item)
        distances = [float(np.linalg.norm(entry.position - self.target.position)) for entry in targets]
        if sum(distance < MAX_NEIGHBOUR_DISTANCE for distance in distances) >= 2:
            raise self.failure("blocked", "two neighbours are too near")
        yield from super().run(cell)


def test_an_object_between_near_neighbours_is_picked_after_they_are_gone() -> None:
    substitutes = {"*/Approach": CarefulApproach}

    def put_a_corner(cell: FakeCell) -> None:
        put(cell, ("cube", 0.43, -0.2), ("sphere", 0.51, -0.2), ("duck", 0.43, -0.12))

    result = run_mission("sort_with_second_chance", arrange=put_a_corner, substitutes=substitutes)
    assert (result.status, list_placed(result)[-1]) == ("SUCCESS", "cube-1")
    assert result.list_failure_reasons("*/Approach") == ["blocked", "blocked"]


def test_the_objects_are_picked_in_the_order_of_the_list() -> None:
    def put_five(cell: FakeCell) -> None:
        put(cell, ("cube", 0.45, 0.0), ("cube", 0.6, 0.1), ("duck", 0.45, 0.15), ("duck", 0.6, -0.15))
        cell.world.put("sphere", 0.5, -0.2)

    result = run_mission("pick_in_order", arrange=put_five)
    assert [item.partition("-")[0] for item in list_placed(result)] == ["duck", "cube", "duck", "cube"]
    assert (result.status, result.items["skipped"]) == ("SUCCESS", 1)


def test_a_missing_object_of_the_list_is_skipped() -> None:
    result = run_mission("pick_in_order", arrange=lambda cell: put(cell, ("duck", 0.5, 0.0)))
    assert (result.status, list_placed(result)) == ("SUCCESS", ["duck-1"])


def test_all_objects_of_the_requested_class_are_sorted_before_the_next_request() -> None:
    def put_four(cell: FakeCell) -> None:
        put(cell, ("cube", 0.45, 0.0), ("duck", 0.45, 0.15), ("cube", 0.6, -0.15), ("sphere", 0.6, 0.1))

    result = run_mission("sort_requested_class", arrange=put_four, requests=["cube", "duck"])
    assert [item.partition("-")[0] for item in list_placed(result)] == ["cube", "cube", "duck"]
    assert (result.status, result.items["skipped"]) == ("SUCCESS", 1)
    ends = [timed.event for timed in result.events if isinstance(timed.event, NodeEnded)]
    assert len([end for end in ends if end.skill == "AwaitRequest"]) == 3
