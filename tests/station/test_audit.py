"""The audit where it could count wrongly."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from at_hand import look

from executive.cell.devices import TrueObject
from executive.cell.objects import UNKNOWN_LABEL, Bin
from executive.geometry import Pose
from executive.station.station import AUDIT_KEYS, count_outcomes
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.items import EmptyBin

ON_TABLE = (0.5, 0.0, 0.025)
NONE = dict.fromkeys(AUDIT_KEYS, 0)
ITEM: Any = SimpleNamespace(state=None, first_position=np.array(ON_TABLE))
BINS = {"red_bin": Bin("red_bin", np.array([0.2, -0.44, 0]), np.array([0.2, 0.2, 0.1]), np.zeros((1, 2)))}


def counted(
    bins_of_cube: tuple[str, ...], bin: str | None, *records: Any, label: str = "cube", **state: bool
) -> dict[str, int]:
    """Count one object, by default a cube, that once lay on the table and is now in a bin, or in none."""
    final_object = TrueObject(label, Pose.identity(), 7, [np.array(ON_TABLE)], bin=bin, **state)
    return count_outcomes([final_object], records, BINS, {"cube": bins_of_cube}, max_distance=0.025)


RED = ("red_bin",)
BLUE = ("blue_bin",)
DROPPED = {"is_dropped": True}


@pytest.mark.parametrize(
    ("bins", "state", "end"),
    [
        (RED, {}, {"right": 1}),
        (("blue_bin", "red_bin"), {}, {"right": 1}),
        (BLUE, {}, {"wrong_bin": 1}),
        (RED, {"is_held": True}, {"left": 1}),
        (BLUE, DROPPED, {"elsewhere": 1, "fell_in_wrong_bin": 1}),
        (RED, DROPPED, {"right": 1}),
    ],
)
def test_a_body_counts_by_its_class_and_by_who_put_it_there(bins, state, end: dict[str, int]) -> None:
    assert counted(bins, "red_bin", **state) == {**NONE, "unseen": 1, **end}


@pytest.mark.parametrize(
    ("bins", "bin", "state", "end"),
    [
        (RED, "red_bin", {}, "right"),
        (BLUE, "red_bin", {}, "wrong_bin"),
        (RED, "red_bin", DROPPED, "elsewhere"),
        (RED, "", {}, "elsewhere"),
    ],
)
def test_a_removed_body_counts_if_it_was_seen_or_in_a_wrong_bin(bins, bin, state, end: str) -> None:
    counts = {**NONE, end: 1}
    assert counted(bins, bin, ITEM, is_removed=True, **state) == counts
    assert counted(bins, bin, is_removed=True, **state) == (counts if end == "wrong_bin" else NONE)


@pytest.mark.parametrize(
    ("bin", "records", "end"),
    [
        ("", [], {}),
        (None, [], {}),
        ("red_bin", [], {"wrong_bin": 1}),
        ("", [ITEM], {"left": 1}),
        (None, [ITEM], {"elsewhere": 1}),
    ],
)
def test_an_unknown_object_counts_if_it_was_seen_or_is_in_a_bin(bin, records, end: dict[str, int]) -> None:
    assert counted(RED, bin, *records, label=UNKNOWN_LABEL) == {**NONE, **end}


def test_an_object_that_is_just_released_stays_when_its_bin_is_emptied(fake: FakeCell) -> None:
    cube = fake.world.put("cube", 0.5, 0.0)
    look(fake)
    fake.ledger.record_grasp("cube-1")
    x, y, _ = fake.cell.bins["red_bin"].position
    cube.position[:2] = (x, y)
    fake.world.put("cube", x + 0.08, y)
    fake.arm.set_tool_position(np.array((x, y, 0.08)))
    fake.empty_bins([])
    fake.advance()
    assert fake.world.objects == [cube]


def test_only_an_object_in_a_wrong_bin_stays_in_the_audit_when_the_bins_are_emptied(
    fake: FakeCell,
) -> None:
    for label, bin in (("cube", "red_bin"), ("duck", "red_bin"), ("cube", "blue_bin")):
        fake.world.put(label, *fake.cell.bins[bin].position[:2])
    run_skill(EmptyBin(bin="red_bin"), fake)
    # The run may end before the next tick.
    audit = fake.audit()
    left = [(each.label, each.bin) for each in fake.driver.list_final_objects()]
    assert left == [("cube", "blue_bin"), ("duck", "red_bin")]
    assert [each.label for each in fake.world.objects] == ["cube"]
    assert audit is not None
    assert (audit["right"], audit["wrong_bin"]) == (1, 2)
