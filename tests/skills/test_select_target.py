"""Selection of targets and bins: order, belief, deferral, quotas; lists of items."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from at_hand import look

from executive.station.station import CellOptions, SilentOperator
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import SkillResult, run_skill
from skills.items import Defer, ListItems
from skills.select_target import SelectTarget


def select(fake: FakeCell, targets, **values) -> SkillResult:
    return run_skill(SelectTarget(targets=targets, **values), fake)


def put(fake: FakeCell, **places: tuple[float, float]) -> None:
    for label, place in places.items():
        fake.world.put(label, *place)


def test_without_a_preference_the_shortest_tour_decides(fake: FakeCell, look) -> None:
    put(fake, cube=(0.5, 0.2), duck=(0.5, -0.15))
    fake.arm.set_tool_position(np.array([0.5, 0.05, 0.3]))
    assert select(fake, look(), prefer="nearest").outputs["item"] == "cube-1"
    assert select(fake, look()).outputs["item"] == "duck-1"


def test_of_several_bins_the_one_with_the_fewest_objects_is_next_the_first_among_equals(
    fake: FakeCell, look
) -> None:
    fake.routes["cube"] = ("blue_bin", "red_bin")
    for x in (0.45, 0.55, 0.65):
        fake.world.put("cube", x, 0.0)
    chosen = []
    for target in look():
        chosen.append(select(fake, [target]).outputs["bin"])
        fake.ledger.record_placement(target.item, chosen[-1])
    assert chosen == ["blue_bin", "red_bin", "blue_bin"]


def test_neither_a_rejected_item_nor_a_neighbour_of_a_picked_one_is_taken(fake: FakeCell, look) -> None:
    put(fake, cube=(0.50, 0.0), duck=(0.55, 0.0), sphere=(0.60, 0.2))
    targets = look()
    fake.ledger.record_grasp("cube-1")
    result = select(fake, targets)
    assert (result.outputs["item"], result.outputs["bin"]) == ("sphere-1", "blue_bin")
    assert result.commands == ["decided sphere-1 blue_bin"]
    fake.ledger.reject("sphere-1", "slippery")
    assert select(fake, targets).reason == "doubtful", "the duck may have been moved"


def test_only_the_same_item_or_the_wanted_class_will_do(fake: FakeCell, look) -> None:
    put(fake, cube=(0.6, 0.2), duck=(0.45, -0.2))
    targets = look()
    assert select(fake, targets, same="cube-1").outputs["item"] == "cube-1"
    assert select(fake, targets, wanted="cube").outputs["item"] == "cube-1"
    result = select(fake, targets, wanted="sphere")
    assert (result.reason, result.message[:22]) == ("unseen", "no sphere is in sight,")
    look("full")
    assert select(fake, look("full"), wanted="sphere").reason == "no_candidate"
    assert select(fake, look("full"), **{"not": ["cube-1", "duck-1"]}).reason == "no_candidate"


@pytest.mark.parametrize(
    ("view", "reasons"), [("table", ["unseen"] * 5), ("full", ["unseen", "no_candidate"])]
)
def test_two_empty_looks_at_the_full_frame_alone_are_believed(
    fake: FakeCell, look, view: str, reasons: list[str]
) -> None:
    results = [select(fake, look(view)) for _ in reasons]
    assert [result.reason for result in results] == reasons


def test_a_deferred_item_comes_after_the_others_in_the_order_of_deferral(fake: FakeCell, look) -> None:
    put(fake, cube=(0.45, 0.0), duck=(0.5, 0.15), sphere=(0.6, -0.2))
    targets = look()
    for item in ("cube-1", "duck-1"):
        assert run_skill(Defer(item=item), fake).commands == [f"ledger.defer {item}"]
    chosen = []
    while targets:
        chosen.append(select(fake, targets).outputs["item"])
        targets = [target for target in targets if target.item != chosen[-1]]
    assert chosen == ["sphere-1", "cube-1", "duck-1"]


def test_a_deferred_item_waits_until_looks_agree_on_the_others(
    fake: FakeCell, look, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(fake, cube=(0.45, 0.0), sphere=(0.6, -0.2))
    targets = look()
    fake.ledger.defer("cube-1")
    monkeypatch.setattr(fake.ledger, "find_uncertain_items", lambda: ["sphere-1"])
    result = select(fake, [target for target in targets if target.item == "cube-1"])
    assert result.reason == "doubtful"
    assert "cube-1 is deferred, and not enough looks agree on sphere-1" in result.message


def test_an_item_is_deferred_a_limited_number_of_times(fake: FakeCell, look) -> None:
    put(fake, cube=(0.45, 0.0))
    look()
    results = [run_skill(Defer(item="cube-1", times=2), fake) for _ in range(3)]
    assert [result.reason for result in results] == ["", "", "exhausted"]
    assert results[-1].message == "cube-1 was already deferred 2 times"


def test_the_least_tried_item_comes_first_and_of_equals_the_nearest(fake: FakeCell, look) -> None:
    put(fake, cube=(0.45, 0.0), duck=(0.5, 0.15), sphere=(0.6, -0.2))
    look()
    fake.ledger.record_failed_pick("duck-1")
    targets = look()
    assert select(fake, targets).outputs["item"] == "duck-1"
    assert select(fake, targets, prefer="least_tried").outputs["item"] == "cube-1"


def test_only_the_items_of_one_list_and_none_of_another_are_selected(fake: FakeCell, look) -> None:
    put(fake, cube=(0.45, 0.0), duck=(0.5, 0.15), sphere=(0.6, -0.2))
    targets = look()
    assert select(fake, targets, among=["sphere-1", "duck-1"]).outputs["item"] == "duck-1"
    assert select(fake, targets, **{"not": ["cube-1"]}).outputs["item"] == "duck-1"
    both = {"among": ["cube-1", "duck-1"], "not": ["duck-1"]}
    assert select(fake, targets, **both).outputs["item"] == "cube-1"


def test_nothing_is_left_once_no_item_of_the_list_is_open(fake: FakeCell, look) -> None:
    put(fake, cube=(0.45, 0.0), duck=(0.5, 0.15))
    targets = look()
    fake.ledger.reject("cube-1", "slippery")
    assert select(fake, targets, among=["cube-1"]).reason == "no_candidate"
    assert select(fake, [], among=["duck-1"]).reason == "unseen"


@pytest.mark.parametrize(
    ("values", "items"),
    [
        ({}, ["cube-1", "duck-1", "sphere-1"]),
        ({"class": "duck"}, ["duck-1"]),
        ({"state": "deferred"}, ["duck-1"]),
        ({"state": "rejected"}, ["cube-2"]),
        ({"state": "placed"}, ["sphere-2"]),
        ({"state": "placed", "bin": "red_bin"}, []),
        ({"state": "lost"}, ["duck-2"]),
        ({"state": "skipped"}, []),
    ],
)
def test_items_are_listed_by_state_class_and_bin(
    fake: FakeCell, look, values: dict[str, str], items: list[str]
) -> None:
    for x, label in itertools.product((0.4, 0.6), ("cube", "duck", "sphere")):
        fake.world.put(label, x, {"cube": -0.2, "duck": 0.0, "sphere": 0.2}[label])
    look()
    fake.ledger.defer("duck-1")
    fake.ledger.reject("cube-2", "slippery")
    for item in ("sphere-2", "duck-2"):
        fake.ledger.record_grasp(item)
        if item == "sphere-2":
            fake.ledger.record_placement(item, "blue_bin")
    fake.ledger.record_drop("duck-2")
    assert sorted(run_skill(ListItems(**values), fake).outputs["items"]) == items


ALL_BINS = ("red_bin", "blue_bin", "yellow_bin")


def make_cell(limits: dict[tuple[str, str | None], int], *labels: str) -> FakeCell:
    """Return a cell with a row of objects, whose cubes may go into all bins."""
    options = CellOptions(SilentOperator(), cell_folder=Path(), quotas=limits)
    fake = FakeCell(routes={"cube": ALL_BINS, "sphere": ("red_bin",)}, options=options)
    for index, label in enumerate(labels):
        fake.world.put(label, 0.44 + 0.1 * (index % 3), 0.12 * (index // 3))
    return fake


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
