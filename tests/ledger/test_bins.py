"""Dropped items: sought on the table and in the bins, and believed where they came down."""

from __future__ import annotations

import numpy as np
import pytest
from ledger_bench import Bench, Thing, take_frame

from executive.cell.frame import BinAppearance
from executive.cell.objects import ObjectClass
from executive.events import ItemChanged

OVER = np.array([0.2, -0.44, 0.025])
"""The middle of the red bin, which the image of the view `table` does not show."""
CUBE: Thing = ("cube", 0.5, 0.0)
IN_RED: Thing = ("cube", 0.2, -0.44)
LOST = ("lost", "known to exist, not found again")


@pytest.mark.parametrize(
    ("landing", "final"),
    [
        (OVER, ("placed", "red_bin")),
        (None, LOST),
        (np.array([0.5, 0.0, 0.025]), LOST),
        (np.array([0.3, -0.44, 0.025]), LOST),
        (np.array([0.276, -0.44, 0.025]), LOST),
        (np.array([0.274, -0.44, 0.025]), ("placed", "red_bin")),
        (np.array([-0.2, 0.44, 0.025]), LOST),
    ],
    ids=["bin", "unknown", "table", "wall", "near the wall", "not so near", "bin of another class"],
)
def test_what_came_down_in_its_bin_is_there_though_no_look_shows_it(
    bench: Bench, landing: np.ndarray | None, final: tuple[str, str]
) -> None:
    bench.look(CUBE, view="full")
    bench.drop("cube-1", landing)
    for _ in range(3):
        bench.look()
    assert bench.end() == {"cube-1": final}
    why = "it probably fell into the bin" if final[0] == "placed" else final[1]
    assert bench.ledger.list_items()[0].reason == why
    assert bench.ledger.describe("cube-1").attempts == 1


def test_what_must_have_fallen_into_a_bin_takes_a_place_there_until_a_look_shows_otherwise(
    bench: Bench,
) -> None:
    bench.look(CUBE, view="full")
    bench.drop("cube-1", OVER)
    assert bench.ledger.count_objects_in("red_bin") == 1
    bench.look(view="full")
    assert (bench.ledger.count_objects_in("red_bin"), bench.states()["cube-1"][0]) == (0, "dropped")
    bench.look(IN_RED, view="full")
    assert bench.ledger.count_objects_in("red_bin") == 1
    (row,) = bench.ledger.list_items()
    assert (row.state, row.bin, row.reason) == ("placed", "red_bin", "")


@pytest.mark.parametrize(
    ("y", "placed"), [(-0.44 + 0.12 + 0.003, 2), (-0.44 + 0.12 + 0.007, 1)], ids=["on the wall", "beside it"]
)
def test_what_leans_on_the_wall_of_its_bin_is_in_it_and_what_lies_beside_it_is_no_target(
    bench: Bench, y: float, placed: int
) -> None:
    bench.look(CUBE, ("cube", 0.6, 0.1), view="full")
    bench.place("cube-1")
    bench.drop("cube-2")
    assert bench.look(("cube", 0.2, y), IN_RED, view="full") == []
    assert bench.ledger.count_states()["placed"] == placed


def test_what_was_given_up_is_found_in_its_bin_all_the_same(bench: Bench) -> None:
    bench.look(CUBE, view="full")
    bench.drop("cube-1")
    assert bench.ledger.describe("cube-1").state == "lost"
    bench.ledger.reject("cube-1", "12 attempts failed")
    assert bench.ledger.describe("cube-1").state == "rejected"
    bench.look(IN_RED, view="full")
    assert bench.states() == {"cube-1": ("placed", "red_bin")}


def test_a_dropped_item_is_recognized_where_it_lies(bench: Bench) -> None:
    bench.look(CUBE, ("cube", 0.6, 0.1), view="full")
    bench.drop("cube-1")
    found = bench.look(("cube", 0.6, 0.1), ("cube", 0.30, -0.3), view="full")
    assert [(t.item, t.position[0]) for t in found] == [("cube-1", 0.30), ("cube-2", pytest.approx(0.6))]


def test_one_object_more_in_a_bin_of_its_class_than_was_let_go_there_is_the_dropped_one(bench: Bench) -> None:
    bench.look(("cube", 0.45, 0.0), view="full")
    bench.place("cube-1")
    bench.look(("cube", 0.60, 0.0))
    bench.drop("cube-2")
    bench.look(IN_RED, view="full")
    assert bench.ledger.count_states()["placed"] == 1, "the cube in the red bin is the released one"
    bench.look(IN_RED, ("cube", 0.2, 0.44), view="full")
    assert bench.states()["cube-2"] == ("placed", "pink_bin")


def test_an_object_that_was_in_the_bin_at_the_start_is_not_the_dropped_one(bench: Bench) -> None:
    bench.look(CUBE, IN_RED, view="full")
    bench.drop("cube-1")
    bench.look(IN_RED, view="full")
    assert bench.states()["cube-1"][0] == "dropped"
    bench.look(IN_RED, ("cube", 0.2, -0.36), view="full")
    assert bench.states()["cube-1"] == ("placed", "red_bin")


@pytest.fixture
def boxes() -> Bench:
    """A ledger that knows the size of the cubes."""
    return Bench({"cube": ObjectClass("cube", 0.05, 0.0354, footprint=(0.05, 0.05), flat_top=True)})


@pytest.mark.parametrize(
    ("areas", "text"),
    [
        ([0.003, 0.0], ""),
        ([0.003, 0.003], "something came into red_bin, and the robot did not do it"),
    ],
)
def test_two_images_name_an_object_in_a_bin_that_the_robot_did_not_bring(
    boxes: Bench, areas: list[float], text: str
) -> None:
    for area in areas:
        boxes.ledger.observe_bins({"red_bin": BinAppearance(None, area)}, take_frame())
    assert [event.text for event in boxes.ledger.unexplained.events] == [text] * bool(text)


def test_a_bin_keeps_the_objects_that_the_robot_brought(boxes: Bench) -> None:
    boxes.look(CUBE, view="full")
    boxes.place("cube-1")
    for area in (0.004, 0.0038, 0.0, 0.0038, 0.0):
        boxes.ledger.observe_bins({"red_bin": BinAppearance(None, area, is_whole=True)}, take_frame())
    assert not boxes.ledger.unexplained.events
    boxes.ledger.observe_bins({"red_bin": BinAppearance(None, 0.0, is_whole=True)}, take_frame())
    (event,) = boxes.ledger.unexplained.events
    assert event.text == "something left red_bin, and the robot did not do it"


@pytest.mark.parametrize(
    ("area", "text"),
    [
        (0.0084, ""),
        (0.0064, ""),
        (0.0048, "something left red_bin, and the robot did not do it"),
        (0.0140, "something came into red_bin, and the robot did not do it"),
    ],
    ids=["both", "both at the near side", "one of two", "three"],
)
def test_the_first_images_of_a_bin_after_placements_show_what_the_robot_brought(
    boxes: Bench, area: float, text: str
) -> None:
    boxes.look(CUBE, ("cube", 0.6, 0.1), view="full")
    boxes.place("cube-1")
    boxes.place("cube-2")
    for _ in range(2):
        boxes.ledger.observe_bins({"red_bin": BinAppearance(None, area, is_whole=True)}, take_frame())
    assert [event.text for event in boxes.ledger.unexplained.events] == [text] * bool(text)


def test_what_the_robot_brings_does_not_hide_what_an_image_showed_before(boxes: Bench) -> None:
    boxes.look(CUBE, ("cube", 0.6, 0.1), view="full")
    boxes.ledger.observe_bins({"red_bin": BinAppearance(None, 0.0022, is_whole=True)}, take_frame())
    boxes.place("cube-1")
    boxes.place("cube-2")
    boxes.ledger.observe_bins({"red_bin": BinAppearance(None, 0.0090, is_whole=True)}, take_frame())
    boxes.end()
    (event,) = boxes.ledger.unexplained.events
    assert event.text == "something came into red_bin, and the robot did not do it"


@pytest.mark.parametrize("is_whole", [True, False])
def test_a_bin_that_no_image_showed_whole_after_a_placement_is_an_assumption(
    boxes: Bench, is_whole: bool
) -> None:
    boxes.look(CUBE, view="full")
    boxes.place("cube-1")
    boxes.ledger.observe_bins({"red_bin": BinAppearance(None, 0.004, is_whole=is_whole)}, take_frame())
    boxes.end()
    assert any("red_bin" in reason for reason in boxes.ledger.assumption_reasons) is not is_whole


@pytest.mark.parametrize("between", [[], [()]], ids=["seen at once", "appeared later"])
def test_an_item_that_looks_show_where_it_was_picked_is_not_in_the_bin(bench: Bench, between: list) -> None:
    bench.look(CUBE, view="full")
    bench.place("cube-1")
    for things in [*between, (CUBE,), (CUBE,)]:
        bench.look(*things)
    is_replaced = not between
    assert bench.ledger.count_objects_in("red_bin") == (not is_replaced)
    assert bench.states()["cube-1"] == (("phantom", "it is cube-2") if is_replaced else ("placed", "red_bin"))
    assert len(bench.ledger.unexplained.events) == bench.ledger.false_grasp_count == is_replaced


@pytest.mark.parametrize(
    ("shown", "placed"),
    [([IN_RED], ["red_bin"]), ([("cube", 0.2, 0.44), IN_RED], ["red_bin"]), ([("cube", -0.2, 0.44)], [])],
    ids=["its bin", "two of its bins", "a bin of another class"],
)
def test_a_dropped_item_is_placed_once_in_a_bin_of_its_class(
    bench: Bench, shown: list[Thing], placed: list[str]
) -> None:
    bench.look(CUBE, view="full")
    bench.drop("cube-1")
    assert bench.look(*shown, view="full") == []
    changes = [event for event in bench.events if isinstance(event, ItemChanged)]
    assert [change.bin for change in changes if change.state == "placed"] == placed
    assert len(bench.ledger.records) == 1, "what lies in a bin is no item"


def test_the_items_of_an_emptied_bin_stay_placed_and_no_longer_count_in_it(bench: Bench) -> None:
    bench.look(CUBE, ("cube", 0.6, 0.1), view="full")
    bench.place("cube-1")
    bench.drop("cube-2", OVER)
    ledger = bench.ledger
    ledger.empty_bins(["red_bin"])
    assert (ledger.count_objects_in("red_bin"), ledger.find_next_slot_index("red_bin")) == (0, 0)
    assert (ledger.count_items("placed", "cube"), ledger.count_items("placed", bin="red_bin")) == (2, 0)
    assert (ledger.describe("cube-1").state, ledger.describe("cube-1").bin) == ("placed", "")
    assert bench.verify("cube-1", IN_RED) == "hidden"
    assert bench.end() == {}, "a long run keeps no record of them"
    assert [(item.item, item.bin) for item in ledger.list_items()] == [
        ("cube-1", "red_bin"), ("cube-2", "red_bin"),
    ]  # fmt: skip
    assert (ledger.count_states()["seen"], ledger.count_states()["placed"]) == (2, 2)
