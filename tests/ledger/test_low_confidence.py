"""Low-confidence detections: neither seen nor searched in vain."""

from __future__ import annotations

import pytest
from ledger_bench import Bench

from executive.events import FrameSearched, ItemChanged
from executive.ledger.certainty import MIN_UNCERTAIN_LOOKS_TO_REJECT

THERE = ("cube", 0.5, 0.0)
UNSURE = ("rejected", "it has no confident detection")
PHANTOM = ("phantom", "more looks missed it than saw it")


def test_an_object_with_uncertain_detections_only_is_an_item_in_doubt(bench: Bench) -> None:
    assert [target.item for target in bench.look(unsure=[THERE])] == ["cube-1"]
    assert (bench.ledger.list_items()[0].looks, bench.ledger.is_certain("cube-1")) == (0, False)
    assert bench.ledger.find_uncertain_items() == ["cube-1"]
    look = next(event for event in bench.events if isinstance(event, FrameSearched))
    assert (look.confident, [one.label for one in look.doubtful]) == ([], ["cube"])


@pytest.mark.parametrize("unsure", [[], [THERE], [("duck", 0.5, 0.0)]], ids=["nothing", "cube", "no route"])
def test_a_table_with_something_in_doubt_is_not_believed_to_be_empty(bench: Bench, unsure: list) -> None:
    for _ in range(6):
        bench.look(view="full", unsure=unsure)
    assert bench.ledger.is_table_empty() is not bool(unsure)


@pytest.mark.parametrize(
    ("uncertain", "misses", "ended", "final"),
    [
        (1, 2, False, PHANTOM),
        (1, 1, True, PHANTOM),
        (1, 0, True, UNSURE),
        (MIN_UNCERTAIN_LOOKS_TO_REJECT - 1, 0, False, ("seen", "")),
        (MIN_UNCERTAIN_LOOKS_TO_REJECT, 0, False, UNSURE),
        (MIN_UNCERTAIN_LOOKS_TO_REJECT, 0, True, UNSURE),
        (MIN_UNCERTAIN_LOOKS_TO_REJECT, 3, True, PHANTOM),
    ],
)
def test_what_no_look_is_sure_of_is_given_up_and_what_looks_miss_was_nothing(
    bench: Bench, uncertain: int, misses: int, ended: bool, final: tuple[str, str]
) -> None:
    for _ in range(uncertain):
        bench.look(unsure=[THERE])
    for _ in range(misses):
        bench.look()
    assert (bench.end() if ended else bench.states()) == {"cube-1": final}
    assert bench.ledger.find_uncertain_items() == (["cube-1"] if final[0] == "seen" else [])


def test_given_up_too_early_it_is_open_again_when_a_look_is_sure(bench: Bench) -> None:
    for _ in range(MIN_UNCERTAIN_LOOKS_TO_REJECT):
        bench.look(unsure=[THERE])
    bench.look(THERE)
    assert bench.states() == {"cube-1": ("seen", "")}


def test_an_uncertain_detection_where_nothing_can_have_been_overlooked_or_in_a_bin_is_nothing(
    bench: Bench,
) -> None:
    bench.look(view="full", unsure=[("cube", 0.2, -0.44)])
    for _ in range(3):
        bench.look()
    bench.look(unsure=[THERE])
    assert bench.ledger.list_items() == []


def test_a_sure_look_makes_an_item_of_an_uncertain_detection_as_good_as_any(bench: Bench) -> None:
    other = Bench()
    bench.look(unsure=[("duck", 0.5, 0.0)])
    for one in (bench, bench, other, other):
        one.look(THERE)
    mine, others = bench.ledger.records[0], other.ledger.records[0]
    assert (mine.item, mine.label, mine.belief.class_error) == ("duck-1", "cube", others.belief.class_error)
    assert mine.belief.log_odds == pytest.approx(others.belief.log_odds, abs=2.0)
    assert bench.ledger.is_certain("duck-1")


def test_a_look_that_is_unsure_of_a_known_item_does_not_miss_it(bench: Bench) -> None:
    bench.look(THERE, unsure=[("duck", 0.51, 0.01)])
    assert (len(bench.ledger.list_items()), bench.ledger.records[0].belief.low_confidence_count) == (1, 0), (
        "a second, weaker box"
    )
    for _ in range(5):
        bench.look(unsure=[("duck", 0.51, 0.0)])
    record = bench.ledger.records[0]
    assert (record.belief.miss_probability, record.label, record.belief.low_confidence_count) == (
        1.0,
        "cube",
        0,
    )
    assert bench.end() == {"cube-1": ("skipped", "the mission was completed without it")}


def test_given_up_after_a_failed_grasp_it_stays_so(bench: Bench) -> None:
    bench.look(THERE)
    bench.ledger.record_failed_pick("cube-1")
    for _ in range(MIN_UNCERTAIN_LOOKS_TO_REJECT):
        bench.look(unsure=[THERE])
    bench.look(THERE)
    assert bench.states() == {"cube-1": UNSURE}


def test_a_known_item_that_waits_its_turn_is_not_rejected_for_uncertain_looks(bench: Bench) -> None:
    for _ in range(3):
        bench.look(THERE, ("cube", 0.55, 0.0))
    for _ in range(MIN_UNCERTAIN_LOOKS_TO_REJECT + 5):
        bench.look(("cube", 0.55, 0.0), unsure=[THERE])
    assert bench.ledger.is_certain("cube-1")
    bench.ledger.record_grasp("cube-2")  # its neighbour
    bench.look(unsure=[THERE])
    assert bench.states()["cube-1"] == ("seen", "")


def test_what_is_gone_is_not_what_a_look_is_unsure_of_later(bench: Bench) -> None:
    for _ in range(3):
        bench.look(THERE, ("cube", 0.6, 0.15))
    for _ in range(3):
        bench.look(("cube", 0.6, 0.15))
    bench.drop("cube-2")
    for _ in range(3):
        bench.look(view="full", unsure=[THERE])
    assert "cube-3" in bench.ledger.find_uncertain_items()
    assert not bench.ledger.is_table_empty()


def test_a_new_item_that_proves_to_be_one_that_fell_is_reported_as_none(bench: Bench) -> None:
    """It was reported in doubt already: whoever follows the events has to hear what became of it."""
    bench.look(THERE)
    bench.drop("cube-1")
    bench.look(unsure=[("cube", 0.6, 0.1)])
    bench.look(("cube", 0.6, 0.1))
    changes = [event for event in bench.events if isinstance(event, ItemChanged)]
    states = {change.item: (change.state, change.reason) for change in changes}
    assert states == {"cube-1": ("seen", ""), "cube-2": ("phantom", "it is cube-1")}
    assert bench.ledger.describe("cube-2").state == "phantom"
