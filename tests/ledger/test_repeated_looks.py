"""Looks from one pose repeat a share of their errors, so only the independent share adds up."""

from __future__ import annotations

from dataclasses import replace

import pytest
from ledger_bench import EYE, Bench

from executive.cell.objects import ObjectClass
from executive.ledger.certainty import Certainty

DOUBTFUL = replace(EYE, confusion_rate=0.05, repeated=0.8)
CUBE = ("cube", 0.5, 0.0)


def record_of(bench: Bench):
    (record,) = bench.ledger.records
    return record


def test_the_same_answer_from_the_same_pose_proves_a_class_only_a_little_more(bench):
    chances = []
    for _ in range(3):
        bench.look(CUBE, by=DOUBTFUL)
        chances.append(record_of(bench).belief.class_error)
    # The odds 19 grow by (0.8 + 0.2 * 0.95) / (0.8 + 0.2 * 0.05) with each further look.
    ratio = 0.99 / 0.81
    assert [1 / chance - 1 for chance in chances] == pytest.approx([19, 19 * ratio, 19 * ratio**2])


def test_after_three_looks_an_item_without_other_evidence_is_rejected_with_both_values(bench):
    for _ in range(3):
        bench.look(CUBE, by=DOUBTFUL)
    why = "3 looks from one pose leave a probability of 3.4% that it is no cube; at most 0.5% is allowed"
    assert bench.states() == {"cube-1": ("rejected", why)}


def test_an_item_whose_class_a_touch_can_prove_is_sure_enough_to_be_touched_after_three_looks():
    bench = Bench({"cube": ObjectClass("cube", height=0.05, radius=0.0354)})
    sure = []
    for _ in range(3):
        bench.look(CUBE, by=DOUBTFUL)
        sure.append(bench.ledger.is_certain("cube-1"))
    assert sure == [False, False, True]


def test_another_detector_at_the_same_pose_is_second_evidence(bench):
    bench.look(CUBE, by=DOUBTFUL)
    bench.look(CUBE, by=DOUBTFUL, detector="other")
    record = record_of(bench)
    assert 1 / record.belief.class_error - 1 == pytest.approx(19**2)


def test_an_item_that_was_moved_is_looked_at_as_if_for_the_first_time(bench):
    bench.look(CUBE, by=DOUBTFUL)
    bench.ledger.invalidate_positions()
    bench.look(CUBE, by=DOUBTFUL)
    record = record_of(bench)
    assert (record.belief.repeat_count, 1 / record.belief.class_error - 1) == (0, pytest.approx(19**2))


def test_a_place_searched_again_from_the_same_pose_is_hardly_emptier():
    once, twice, apart = Bench(), Bench(), Bench()
    for bench, views in ((once, ["eye"]), (twice, ["eye", "eye"]), (apart, ["eye", "other"])):
        for detector in views:
            bench.look(by=replace(EYE, miss_rate=0.2, repeated=0.8), view="full", detector=detector)
    # A chance of 0.2 after the first look, times 0.8 + 0.2 * 0.2 or times 0.2 after the second one.
    assert [bench.overlooked(0.5, 0.0) for bench in (once, twice, apart)] == pytest.approx([0.2, 0.168, 0.04])


def test_the_systematic_error_of_a_position_does_not_shrink_with_the_number_of_looks(bench):
    certainty = Certainty(bench.config, ())
    for _ in range(5):
        bench.look(CUBE, by=replace(EYE, bias=0.006))
    record = record_of(bench)
    assert (record.standard_error < 0.002, certainty.is_certain(record)) == (True, False)
