"""A detector that takes one class for another, or uses labels that the cell does not know."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest

from executive.cell.detection import Detection
from executive.cells.fake.cell import FakeCell
from executive.testing.run_mission import MissionResult, run_mission

OBJECTS = (("cube", 0.46, -0.12), ("sphere", 0.58, 0.0), ("cube", 0.5, 0.14), ("duck", 0.6, 0.16))


def sorted_with(mission: str, labels: dict[str, str]) -> MissionResult:
    """Sort `OBJECTS` with a detector that gives some classes another label."""

    def relabel(look: int, true: Sequence[Detection]) -> Sequence[Detection]:
        return [replace(one, label=labels.get(one.label, one.label)) for one in true]

    def arrange(fake: Any) -> None:
        fake.world.objects.clear()
        for thing in OBJECTS:
            fake.world.put(*thing)
        fake.detector.make_answer = relabel

    return run_mission(mission, FakeCell, arrange=arrange)


@pytest.mark.parametrize("mission", ["sort_overhead", "sort_wrist"])
def test_a_class_that_is_always_mistaken_is_in_no_wrong_bin_and_rejected_by_its_height(mission: str) -> None:
    result = sorted_with(mission, {"cube": "sphere"})
    assert (result.status, result.items["placed"], result.items["rejected"]) == ("INCOMPLETE", 2, 2)
    assert (result.audit["wrong_bin"], result.agrees) == (0, True)
    reasons = [row.reason for row in result.accounts.list_items() if row.state == "rejected"]
    # The fake tool feels a surface from 2 mm above it.
    height = "it was touched 52 mm above the table, and a sphere is 60 mm high"
    assert reasons == [f"could not be picked: {height}"] * 2
    assert height in result.message
    assert result.list_failure_reasons().count("contradicted") == 6


def test_labels_that_the_cell_does_not_know_are_reported_and_the_table_is_not_empty() -> None:
    result = sorted_with("sort_overhead", {"cube": "box", "duck": "rubber-duck"})
    assert (result.status, result.items["placed"], result.accounts.unknown_labels) == (
        "SUCCESS", 1, {"box": 2, "rubber-duck": 1},
    )  # fmt: skip
    assert (result.is_table_empty, result.audit["unseen"]) == (False, 3)
