"""Answers to the question whether an item is at its place, and items that left their place."""

from __future__ import annotations

from dataclasses import replace

import pytest
from ledger_bench import EYE, Bench

CUBE, ELSEWHERE = ("cube", 0.5, 0.0), ("cube", 0.6, 0.15)
SLOT_1, SLOT_2 = ("cube", 0.15, -0.36), ("cube", 0.25, -0.36)


@pytest.fixture
def placed(bench: Bench) -> Bench:
    """A ledger whose only item, cube-1, was placed in the red bin."""
    for _ in range(3):
        bench.look(CUBE)
    bench.place("cube-1")
    return bench


@pytest.fixture
def gone(placed: Bench) -> Bench:
    """A ledger whose only item, cube-1, was placed in the red bin and is gone."""
    placed.look(view="full")
    assert [placed.verify("cube-1"), placed.verify("cube-1")] == ["unsure", "gone"]
    return placed


@pytest.fixture
def half_gone(placed: Bench) -> Bench:
    """A ledger whose items cube-1 and cube-2 were placed in the red bin; cube-1 is gone."""
    for _ in range(3):
        placed.look(ELSEWHERE)
    placed.place("cube-2")
    for _ in range(2):
        placed.verify("cube-1", SLOT_2)
    assert placed.states()["cube-1"] == ("dropped", "")
    return placed


def test_an_item_is_gone_only_after_enough_looks(placed: Bench) -> None:
    rates = replace(EYE, repeated=0.6)
    assert placed.verify("cube-1", SLOT_1, by=rates) == "present"
    answers = [placed.verify("cube-1", by=rates) for _ in range(8)]
    # 0.03 for the first miss, and 0.612 for each repeated one.
    assert answers == ["unsure"] * 7 + ["gone"]


def test_no_number_of_misses_from_one_viewpoint_proves_that_an_item_is_gone_that_no_look_has_shown_there(
    placed: Bench,
) -> None:
    rates = replace(EYE, repeated=0.6)
    assert [placed.verify("cube-1", by=rates) for _ in range(100)] == ["unsure"] * 100
    assert placed.states() == {"cube-1": ("placed", "red_bin")}


def test_an_item_that_is_gone_is_open_and_not_placed(gone: Bench) -> None:
    assert gone.states() == {"cube-1": ("dropped", "")}
    assert gone.ledger.describe("cube-1").state == "lost"
    assert gone.ledger.count_objects_in("red_bin") == 0


def test_an_item_that_reappears_on_the_table_keeps_its_identity(gone: Bench) -> None:
    gone.look(ELSEWHERE)
    assert gone.states() == {"cube-1": ("seen", "")}
    assert [target.item for target in gone.ledger.find_targets()] == ["cube-1"]
    gone.place("cube-1")
    assert gone.end()["cube-1"] == ("placed", "red_bin")
    assert gone.ledger.count_states()["seen"] == 1


def test_an_object_at_a_place_that_no_look_searched_before_is_another_item(placed: Bench) -> None:
    for _ in range(2):
        placed.verify("cube-1", hidden=slice(0, 250))
    for _ in range(2):
        placed.look(("cube", 0.5, 0.36), view="full")
    assert placed.states() == {"cube-1": ("dropped", ""), "cube-2": ("seen", "")}


def test_a_doubtful_detection_of_its_class_at_its_slot_shows_the_item(placed: Bench) -> None:
    assert placed.verify("cube-1", unsure=[SLOT_1]) == "present"


def test_of_two_items_the_one_whose_slot_is_empty_is_gone(placed: Bench) -> None:
    for _ in range(3):
        placed.look(ELSEWHERE)
    placed.place("cube-2")
    assert [placed.verify(item, SLOT_1) for item in ("cube-1", "cube-2")] == ["present", "unsure"]
    assert [placed.verify(item, SLOT_2) for item in ("cube-2", "cube-1")] == ["present", "unsure"]


def test_in_a_bin_with_two_layers_no_item_is_gone(bench: Bench) -> None:
    places = [("cube", 0.44 + 0.09 * (number % 3), 0.09 * (number // 3) - 0.12) for number in range(7)]
    for _ in range(3):
        bench.look(*places)
    for number in range(7):
        bench.place(f"cube-{number + 1}")
    assert {bench.verify("cube-1", SLOT_2) for _ in range(5)} == {"unsure"}


def test_an_item_on_the_table_is_there_unsure_or_gone(bench: Bench) -> None:
    for _ in range(3):
        bench.look(CUBE)
    assert bench.verify("cube-1", CUBE) == "present"
    assert [bench.verify("cube-1") for _ in range(2)] == ["unsure", "gone"]
    assert bench.states() == {"cube-1": ("dropped", "")}


def test_what_no_look_can_show_is_hidden(placed: Bench) -> None:
    assert [placed.verify("cube-1", hidden=slice(start, 640)) for start in (0, 400)] == ["hidden"] * 2
    placed.look(ELSEWHERE)
    assert placed.ledger.update_presence("cube-1", *placed.last_look).value == "hidden", "only the table"
    assert placed.verify("cube-2", hidden=slice(0, 640)) == "hidden"
    placed.ledger.record_grasp("cube-2")
    assert placed.verify("cube-2") == "hidden"


@pytest.mark.parametrize(
    ("seen", "unsure"), [([], [SLOT_2]), ([], [("duck", 0.2, -0.44)]), ([("duck", 0.2, -0.44)], [])]
)
def test_a_doubtful_detection_or_another_class_in_the_bin_may_be_the_item(
    placed: Bench, seen: list, unsure: list
) -> None:
    assert [placed.verify("cube-1", *seen, unsure=unsure) for _ in range(5)] == ["unsure"] * 5


def test_the_slot_of_an_item_that_is_gone_stays_used_until_the_bin_is_empty(half_gone: Bench) -> None:
    ledger = half_gone.ledger
    assert (ledger.count_objects_in("red_bin"), ledger.find_next_slot_index("red_bin")) == (1, 2)
    for _ in range(2):
        half_gone.verify("cube-2")
    assert (ledger.count_objects_in("red_bin"), ledger.find_next_slot_index("red_bin")) == (0, 0)


@pytest.mark.parametrize("found_by", [ELSEWHERE, SLOT_1, None], ids=["on the table", "in the bin", "grasp"])
def test_an_item_that_was_found_again_is_missing_no_more(gone: Bench, found_by: tuple | None) -> None:
    (record,) = gone.ledger.records
    assert record.was_taken_away
    for _ in range(2 if found_by else 0):
        gone.look(found_by, view="full")
    if found_by is None:
        gone.ledger.record_grasp("cube-1")
    assert not record.was_taken_away
