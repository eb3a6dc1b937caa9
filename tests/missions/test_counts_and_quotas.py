"""Shipped missions that count objects or limit their number per bin."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from executive.testing.fake_cell import FakeCell
from executive.testing.run_mission import MissionResult, run_mission


def run_with(mission: str | Path, *labels: str, **settings: str) -> MissionResult:
    """Run a mission with these objects on the table."""

    def arrange(fake: FakeCell) -> None:
        fake.world.objects.clear()
        for index, label in enumerate(labels):
            fake.world.put(label, 0.44 + 0.09 * (index % 3), -0.15 + 0.1 * (index // 3))

    return run_mission(mission, arrange=arrange, set=settings)


def count_by_bin(result: MissionResult) -> dict[str, Counter[str]]:
    """Return the number of placed objects by bin and class."""
    counts: dict[str, Counter[str]] = {}
    for row in result.cell.ledger.list_items():
        counts.setdefault(row.bin, Counter())[row.label] += 1
    return counts


def test_two_cubes_fill_each_bin_with_a_quota_and_the_rest_goes_elsewhere() -> None:
    result = run_with("fill_by_quota", *["cube"] * 6, "sphere", "duck")
    assert (result.status, result.agrees) == ("SUCCESS", True)
    assert count_by_bin(result) == {
        "red_bin": {"cube": 2},
        "blue_bin": {"cube": 2},
        "yellow_bin": {"cube": 2, "sphere": 1, "duck": 1},
    }


def test_sorting_ends_after_four_objects_and_the_others_are_skipped() -> None:
    result = run_with("sort_until_four", *["sphere"] * 2, *["cube"] * 3, "sphere")
    assert (result.status, result.items["placed"], result.items["skipped"]) == ("SUCCESS", 4, 2)
    assert count_by_bin(result)["red_bin"] == {"cube": 3}, "the cubes come first"


def test_the_first_kit_is_complete_before_the_second_begins() -> None:
    result = run_with("kit_shapes", "cube", "cube", "cube", "sphere", "sphere", "duck")
    counts = count_by_bin(result)
    assert counts["red_bin"] == {"cube": 1, "sphere": 1, "duck": 1}
    assert counts["blue_bin"] == {"cube": 1, "sphere": 1}
    assert (result.status, result.items["skipped"], result.agrees) == ("SUCCESS", 1, True)
