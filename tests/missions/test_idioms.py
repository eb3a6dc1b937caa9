"""Missions that people ask for, each of at most 20 lines, do what their first line says."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from executive.events import ItemChanged, NodeEnded, TargetSelected
from executive.testing.faults import during, grip_lost
from executive.testing.run_mission import MissionResult, run_mission

FOLDER = Path(__file__).parent / "idioms"
MAX_LINES = 20


def list_events(result: MissionResult, kind: type[Any]) -> list[Any]:
    """Return the events of a kind, in order."""
    return [timed for timed in result.events if isinstance(timed.event, kind)]


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.yaml")), ids=lambda path: path.stem)
@pytest.mark.parametrize("seed", [1, 2])
def test_a_mission_is_short_and_succeeds(path: Path, seed: int) -> None:
    assert len(path.read_text().splitlines()) <= MAX_LINES
    result = run_mission(path, seed=seed)
    assert (result.status, result.agrees) == ("SUCCESS", True)


@pytest.mark.parametrize("seed", [3, 4])
def test_two_bins_are_filled_evenly(seed: int) -> None:
    result = run_mission(FOLDER / "fill_evenly.yaml", seed=seed)
    counts = Counter(known.bin for known in result.ledger.list_items())
    assert abs(counts["red_bin"] - counts["blue_bin"]) <= 1


def test_the_second_drop_of_one_item_ends_the_mission() -> None:
    drops = during("*/Transit", grip_lost())
    result = run_mission(FOLDER / "stop_after_two_drops.yaml", seed=3, faults=[drops])
    assert (result.status, result.agrees) == ("SUCCESS", True)
    (twice,) = [known.item for known in result.ledger.list_known_items() if known.drops == 2]
    skipped = {known.reason for known in result.ledger.list_items() if known.state == "skipped"}
    assert skipped == {f"{twice} fell twice"}


def test_the_largest_y_comes_first() -> None:
    result = run_mission(FOLDER / "largest_y_first.yaml", seed=3)
    selections = [timed.event.item for timed in list_events(result, TargetSelected)]
    places = {
        timed.event.item: timed.event.position[1]
        for timed in reversed(list_events(result, ItemChanged))
        if timed.event.state == "seen"
    }
    ys = [places[item] for item in selections]
    assert ys == sorted(ys, reverse=True)


def test_a_wrong_count_ends_with_the_message_of_the_mission() -> None:
    result = run_mission(FOLDER / "verify_counts.yaml", seed=3, set={"expected": "99"})
    placed = result.items["placed"]
    assert (result.status, result.reason) == ("FAILURE", "fail.wrong_count")
    assert result.message.startswith(f"{placed} of 99 placed, ")


def test_two_objects_are_not_enough() -> None:
    result = run_mission(FOLDER / "wait_for_three.yaml", set={"cell.table.objects": "[2, 2]"})
    assert (result.status, result.items["placed"], result.items["skipped"]) == ("SUCCESS", 0, 2)
    assert 30 <= result.cell.cell.clock.now < 35


def test_an_old_look_is_repeated() -> None:
    result = run_mission(FOLDER / "look_again.yaml", seed=3)
    looks = [timed.clock for timed in list_events(result, NodeEnded) if timed.event.skill == "Detect"]
    assert all(later - earlier < 10 for earlier, later in pairwise(looks))
