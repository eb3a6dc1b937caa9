"""Looks that are unsure, and looks that repeat the errors of earlier looks from the same pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from ledger_bench import EYE, Bench

from executive.cell.frame import Region
from executive.cell.objects import ObjectClass
from executive.events import FrameSearched, ItemChanged
from executive.ledger.certainty import MIN_UNCERTAIN_LOOKS_TO_REJECT, Certainty
from executive.ledger.unexplained import SETTLING_LOOK_COUNT

THERE = ("cube", 0.5, 0.0)
UNSURE = ("rejected", "it has no confident detection")
PHANTOM = ("phantom", "more looks missed it than saw it")
DOUBTFUL = replace(EYE, confusion_rate=0.05, repeated=0.8)


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
    (record,) = bench.ledger.records
    assert record.belief.low_confidence_count == 0, "a second, weaker box"
    for _ in range(5):
        bench.look(unsure=[("duck", 0.51, 0.0)])
    assert (record.belief.miss_probability, record.label) == (1.0, "cube")
    assert record.belief.low_confidence_count == 0
    assert bench.end() == {"cube-1": ("skipped", "the mission was completed without it")}


def test_a_known_item_that_waits_its_turn_is_not_rejected_for_uncertain_looks(bench: Bench) -> None:
    for _ in range(3):
        bench.look(THERE, ("cube", 0.55, 0.0))
    for _ in range(MIN_UNCERTAIN_LOOKS_TO_REJECT + 5):
        bench.look(("cube", 0.55, 0.0), unsure=[THERE])
    assert bench.ledger.is_certain("cube-1")
    bench.ledger.record_grasp("cube-2")  # its neighbour
    bench.look(unsure=[THERE])
    assert bench.states()["cube-1"] == ("seen", "")


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


def record_of(bench: Bench):
    (record,) = bench.ledger.records
    return record


def test_the_same_answer_from_the_same_pose_proves_a_class_only_a_little_more(bench):
    chances = []
    for _ in range(3):
        bench.look(THERE, by=DOUBTFUL)
        chances.append(record_of(bench).belief.class_error)
    # The odds 19 grow by (0.8 + 0.2 * 0.95) / (0.8 + 0.2 * 0.05) with each further look.
    ratio = 0.99 / 0.81
    assert [1 / chance - 1 for chance in chances] == pytest.approx([19, 19 * ratio, 19 * ratio**2])


def test_after_three_looks_an_item_without_other_evidence_is_rejected_with_both_values(bench):
    for _ in range(3):
        bench.look(THERE, by=DOUBTFUL)
    why = "3 looks from one pose leave a probability of 3.4% that it is no cube; at most 0.5% is allowed"
    assert bench.states() == {"cube-1": ("rejected", why)}


def test_an_item_whose_class_a_touch_can_prove_is_sure_enough_to_be_touched_after_three_looks():
    bench = Bench({"cube": ObjectClass("cube", height=0.05, radius=0.0354)})
    sure = []
    for _ in range(3):
        bench.look(THERE, by=DOUBTFUL)
        sure.append(bench.ledger.is_certain("cube-1"))
    assert sure == [False, False, True]


def test_an_item_that_was_moved_is_looked_at_as_if_for_the_first_time(bench):
    bench.look(THERE, by=DOUBTFUL)
    bench.ledger.invalidate_positions()
    bench.look(THERE, by=DOUBTFUL)
    record = record_of(bench)
    assert (record.belief.repeat_count, 1 / record.belief.class_error - 1) == (0, pytest.approx(19**2))


def test_a_place_searched_again_from_the_same_pose_is_hardly_emptier():
    once = Bench()
    twice = Bench()
    apart = Bench()
    for bench, views in ((once, ["eye"]), (twice, ["eye", "eye"]), (apart, ["eye", "other"])):
        for detector in views:
            bench.look(by=replace(EYE, miss_rate=0.2, repeated=0.8), view="full", detector=detector)
    # A chance of 0.2 after the first look, times 0.8 + 0.2 * 0.2 or times 0.2 after the second one.
    assert [bench.overlooked(0.5, 0.0) for bench in (once, twice, apart)] == pytest.approx([0.2, 0.168, 0.04])


def test_the_systematic_error_of_a_position_does_not_shrink_with_the_number_of_looks(bench):
    certainty = Certainty(bench.config, ())
    for _ in range(5):
        bench.look(THERE, by=replace(EYE, bias=0.006))
    record = record_of(bench)
    assert (record.standard_error < 0.002, certainty.is_certain(record)) == (True, False)


@pytest.mark.parametrize(("looks", "is_certain"), [(5, False), (12, True)])
def test_an_item_where_none_is_expected_is_touched_after_many_looks_from_one_viewpoint(
    bench: Bench, looks: int, is_certain: bool
) -> None:
    for _ in range(looks):
        bench.look(("cube", 0.7, 0.33), view="full", by=replace(EYE, repeated=0.9))
    assert bench.ledger.is_certain("cube-1") is is_certain


def test_an_item_that_the_witness_shows_too_exists(bench: Bench) -> None:
    place = np.array([0.7, 0.33, 0.025])
    for looks in range(1, 5):
        bench.look(("cube", 0.7, 0.33), by=replace(EYE, repeated=0.97))
        bench.ledger.observe_regions(bench.last_look[0], [Region((0, 0, 9, 9), place, "something")])
        assert bench.ledger.is_certain("cube-1") is (looks >= SETTLING_LOOK_COUNT)
