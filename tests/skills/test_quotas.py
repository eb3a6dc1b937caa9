"""The bins that SelectTarget chooses, and the final states of items, if bins have quotas."""

from __future__ import annotations

from pathlib import Path

import pytest
from at_hand import look

from executive.cell.workcell import CellOptions
from executive.cells.fake.cell import FakeCell, SilentOperator
from executive.testing.run_skill import SkillResult, run_skill
from skills.select_target import SelectTarget

ALL_BINS = ("red_bin", "blue_bin", "yellow_bin")


def make_cell(limits: dict[tuple[str, str | None], int], *labels: str) -> FakeCell:
    """Return a cell with a row of objects, whose cubes may go into all bins."""
    options = CellOptions(SilentOperator(), cell_folder=Path(), quotas=limits)
    fake = FakeCell(routes={"cube": ALL_BINS, "sphere": ("red_bin",)}, options=options)
    for index, label in enumerate(labels):
        fake.world.put(label, 0.44 + 0.1 * (index % 3), 0.12 * (index // 3))
    return fake


def select(fake: FakeCell, targets, **values) -> SkillResult:
    return run_skill(SelectTarget(targets=targets, **values), fake)


def place_all(fake: FakeCell, targets) -> list[str]:
    """Place one target after the other where SelectTarget says; return the bins, and then the reason."""
    results = []
    for _ in range(len(targets) + 1):
        result = select(fake, targets)
        results.append(result.outputs.get("bin", result.reason))
        if result.status == "FAILURE":
            break
        fake.ledger.record_placement(result.outputs["item"], results[-1])
    return results


def test_bins_with_a_quota_are_filled_in_their_order_before_the_bin_without_one() -> None:
    fake = make_cell({("red_bin", "cube"): 2, ("blue_bin", "cube"): 1}, *["cube"] * 5)
    bins = ["red_bin", "red_bin", "blue_bin", "yellow_bin", "yellow_bin"]
    assert place_all(fake, look(fake))[:5] == bins


@pytest.mark.parametrize("counted_label", [None, "cube"])
def test_a_quota_counts_all_objects_or_those_of_a_class(counted_label: str | None) -> None:
    fake = make_cell({("red_bin", counted_label): 1}, "sphere", "cube")
    cube, sphere = sorted(look(fake), key=lambda target: target.label)
    fake.ledger.record_placement(sphere.item, "red_bin")
    expected_bin = "blue_bin" if counted_label is None else "red_bin"
    assert select(fake, [cube]).outputs["bin"] == expected_bin


def test_without_a_free_quota_no_candidate_is_left_at_once() -> None:
    fake = make_cell({("red_bin", "sphere"): 1}, "sphere", "sphere")
    place_all(fake, look(fake))
    result = select(fake, look(fake), wanted="sphere")
    assert result.reason == "no_candidate"
    assert "and surplus objects; the quota of red_bin is reached" in result.message
