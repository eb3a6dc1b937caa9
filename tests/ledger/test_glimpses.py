"""What a detector is unsure of is neither seen nor searched in vain."""

from __future__ import annotations

import pytest
from ledger_bench import Bench

from executive.ledger.item import GLIMPSES

THERE = ("cube", 0.5, 0.0)


def row(bench: Bench) -> dict[str, object]:
    (only,) = bench.ledger.rows()
    return only


def test_what_is_only_glimpsed_is_an_item_in_doubt(bench: Bench) -> None:
    assert bench.look(unsure=[THERE]) != []
    assert (row(bench)["item"], row(bench)["looks"]) == ("cube-1", 0)
    assert not bench.ledger.is_sure("cube-1")
    assert bench.ledger.in_doubt() == ["cube-1"]


def test_a_table_with_something_in_doubt_is_not_believed_to_be_empty(bench: Bench) -> None:
    for _ in range(6):
        bench.look(view="full")
    assert bench.ledger.believes_empty()
    other = Bench()
    for _ in range(6):
        other.look(view="full", unsure=[THERE])
    assert not other.ledger.believes_empty()


def test_looks_that_miss_it_take_a_glimpse_back(bench: Bench) -> None:
    bench.look(unsure=[THERE])
    bench.look()
    bench.look()
    assert row(bench)["state"] == "phantom"
    assert bench.ledger.in_doubt() == []


def test_a_glimpse_where_nothing_can_have_been_overlooked_is_nothing(bench: Bench) -> None:
    for _ in range(4):
        bench.look()
    bench.look(unsure=[THERE])
    assert bench.ledger.rows() == []


def test_a_sure_look_makes_an_item_of_a_glimpse_as_good_as_any(bench: Bench) -> None:
    other = Bench()
    bench.look(unsure=[("duck", 0.5, 0.0)])
    bench.look(THERE)
    bench.look(THERE)
    other.look(THERE)
    other.look(THERE)
    mine, others = bench.ledger.records[0], other.ledger.records[0]
    assert (mine.item, mine.label, mine.misjudged) == ("duck-1", "cube", others.misjudged)
    assert mine.existence == pytest.approx(others.existence, abs=2.0)
    assert bench.ledger.is_sure("duck-1")


def test_a_look_that_is_unsure_of_a_known_item_does_not_miss_it(bench: Bench) -> None:
    bench.look(THERE)
    for _ in range(5):
        bench.look(unsure=[("duck", 0.51, 0.0)])
    assert (bench.ledger.records[0].overlooked, row(bench)["label"]) == (1.0, "cube")
    bench.ledger.close()
    assert row(bench)["state"] == "rejected", "it lies where it was seen"


def test_a_second_weaker_box_on_what_is_seen_is_nothing(bench: Bench) -> None:
    bench.look(THERE, unsure=[("duck", 0.51, 0.01)])
    assert (len(bench.ledger.rows()), bench.ledger.records[0].glimpses) == (1, 0)


def test_what_no_look_is_ever_sure_of_is_given_up_and_reported(bench: Bench) -> None:
    for _ in range(GLIMPSES):
        assert row(bench)["state"] == "seen" if bench.ledger.rows() else True
        bench.look(unsure=[THERE])
    assert (row(bench)["state"], row(bench)["why"]) == ("rejected", "no look is sure of it")
    assert bench.ledger.in_doubt() == []
    bench.ledger.close()
    assert bench.ledger.balance() == {"seen": 1, "placed": 0, "rejected": 1, "lost": 0, "phantom": 0}


def test_given_up_too_early_it_is_taken_up_again_when_a_look_is_sure(bench: Bench) -> None:
    for _ in range(GLIMPSES):
        bench.look(unsure=[THERE])
    bench.look(THERE)
    assert (row(bench)["state"], row(bench)["why"]) == ("seen", "")


def test_what_was_given_up_in_doubt_and_is_missed_then_was_nothing(bench: Bench) -> None:
    for _ in range(GLIMPSES):
        bench.look(unsure=[THERE])
    for _ in range(3):
        bench.look()
    bench.ledger.close()
    assert row(bench)["state"] == "phantom"


def test_a_known_item_that_waits_its_turn_is_not_given_up_for_glimpses(bench: Bench) -> None:
    for _ in range(3):
        bench.look(THERE)
    for _ in range(2 * GLIMPSES):
        bench.look(unsure=[THERE])
    assert row(bench)["state"] == "seen"
    assert bench.ledger.is_sure("cube-1")


def test_what_no_look_was_sure_of_when_the_run_ended_is_reported(bench: Bench) -> None:
    bench.look(unsure=[THERE])
    bench.ledger.close()
    assert (row(bench)["state"], row(bench)["why"]) == ("rejected", "no look is sure of it")


def test_what_a_look_missed_before_the_run_ended_was_no_object(bench: Bench) -> None:
    bench.look(unsure=[THERE])
    bench.look()
    bench.ledger.close()
    assert row(bench)["state"] == "phantom"


def test_what_is_unsure_in_a_bin_is_no_item(bench: Bench) -> None:
    bench.look(view="full", unsure=[("cube", 0.2, -0.44)])
    assert bench.ledger.rows() == []


def test_the_journal_is_told_what_an_item_in_doubt_rests_on(bench: Bench) -> None:
    bench.look(unsure=[THERE])
    look = next(data for kind, data in bench.events if kind == "look")
    assert (look["found"], [told["label"] for told in look["unsure"]]) == ([], ["cube"])


def test_glimpses_of_an_item_that_waits_are_forgotten_when_its_neighbour_is_picked(bench: Bench) -> None:
    for _ in range(3):
        bench.look(THERE, ("cube", 0.55, 0.0))
    for _ in range(GLIMPSES + 5):
        bench.look(("cube", 0.55, 0.0), unsure=[THERE])
    bench.ledger.held("cube-2")
    bench.look(unsure=[THERE])
    assert bench.ledger.rows()[0]["state"] == "seen"


def test_what_is_gone_is_not_what_a_look_is_unsure_of_later(bench: Bench) -> None:
    for _ in range(3):
        bench.look(THERE, ("cube", 0.6, 0.15))
    for _ in range(3):
        bench.look(("cube", 0.6, 0.15))
    bench.ledger.held("cube-2")
    bench.ledger.dropped("cube-2")
    for _ in range(3):
        bench.look(view="full", unsure=[THERE])
    assert "cube-3" in bench.ledger.in_doubt()
    assert not bench.ledger.believes_empty()


def test_a_guess_at_a_class_without_a_route_leaves_the_table_in_doubt(bench: Bench) -> None:
    for _ in range(4):
        bench.look(view="full", unsure=[("duck", 0.5, 0.0)])
    assert not bench.ledger.believes_empty()


def test_a_new_item_that_proves_to_be_one_that_fell_is_reported_as_none(bench: Bench) -> None:
    """It was told of in doubt already: whoever follows the events has to hear what became of it."""
    bench.look(THERE)
    bench.ledger.held("cube-1")
    bench.ledger.dropped("cube-1")
    bench.look(unsure=[("cube", 0.6, 0.1)])
    bench.look(("cube", 0.6, 0.1))
    states = {data["item"]: (data["state"], data["why"]) for kind, data in bench.events if kind == "item"}
    assert states == {"cube-1": ("seen", ""), "cube-2": ("phantom", "it is cube-1")}
    assert not bench.ledger.is_open("cube-2")
