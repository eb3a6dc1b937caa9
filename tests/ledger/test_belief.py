"""What many looks of a bad detector add up to, and the weight as evidence about the class."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ledger_bench import Bench, take_frame

from executive.cell.frame import Detection, ErrorRates, Observation
from executive.cell.objects import ObjectClass
from executive.geometry import GRAVITY, Yaw, rotate_about_z
from executive.ledger.belief import Belief
from executive.ledger.bin_contents import update_bin_log_odds
from executive.ledger.item import ItemRecord, State
from executive.ledger.look import compute_association_distance
from executive.perception.evidence import compute_weight_log_ratios

GOOD = ErrorRates(threshold=0.5, miss_rate=0.02, confusion_rate=0.0025, false_detections=0.02, jitter=0.7)
BAD = ErrorRates(threshold=0.5, miss_rate=0.2, confusion_rate=0.1, false_detections=0.5, jitter=5.0)
HERE = np.array([0.5, 0.0, 0.025])


def belief(log_odds: float = 0.0) -> Belief:
    return Belief("cube", log_odds)


def record() -> ItemRecord:
    return ItemRecord("cube-1", belief(), HERE, 0, 0.0, False)


@pytest.mark.parametrize(("rejections", "state"), [(2, State.SEEN), (3, State.REJECTED)])
def test_an_item_that_was_rejected_often_is_not_opened_again_at_another_place(
    rejections: int, state: State
) -> None:
    item = record()
    item.rejection_count = rejections
    item.set_state(State.PHANTOM, "more looks missed it than saw it")
    item.merge(record(), 0.1)
    assert (item.state, bool(item.reason)) == (state, state is State.REJECTED)


def test_one_vote_of_a_good_detector_is_enough_for_a_class_and_three_of_a_bad_one() -> None:
    one = belief()
    one.add_detection("cube", GOOD)
    assert one.class_error == pytest.approx(0.0025, rel=0.01)
    other = belief()
    doubts = []
    for _ in range(3):
        other.add_detection("cube", BAD)
        doubts.append(other.class_error)
    assert doubts == [pytest.approx(0.1), pytest.approx(1 / 82), pytest.approx(1 / 730)]


def test_what_looks_say_of_existence_adds_up() -> None:
    seen = belief(-1.0)
    seen.add_detection("cube", GOOD)
    assert seen.log_odds == -1.0, "the first look is in the prior"
    seen.add_detection("cube", GOOD)
    assert seen.log_odds == pytest.approx(-1.0 + math.log(0.98 / (0.02 * 0.02)))
    assert (seen.is_confirmed, seen.look_count) == (False, 2)
    seen.add_detection("cube", GOOD)
    assert (seen.is_confirmed, seen.existence_probability) == (True, 1.0)
    beside = belief(3.0)
    beside.add_detection("cube", GOOD, is_ambiguous=True)
    beside.add_detection("cube", GOOD, is_ambiguous=True)
    assert beside.log_odds == pytest.approx(math.log(0.1)), "it may as well be a known item"
    assert beside.existence_probability == pytest.approx(0.1 / 1.1)


def test_looks_into_a_bin_add_up_from_nothing() -> None:
    fallen = record()
    update_bin_log_odds(fallen, "red_bin", GOOD, has_additional_object=False)
    assert fallen.bin_log_odds == {"red_bin": 0.0}
    update_bin_log_odds(fallen, "red_bin", GOOD, has_additional_object=True)
    assert fallen.bin_log_odds == {"red_bin": pytest.approx(math.log(0.98 / (0.02 * 0.04)))}


@given(st.lists(st.sampled_from(["cube", "duck", "sphere"]), min_size=1, max_size=12))
def test_the_chance_of_a_wrong_class_is_one_and_the_label_is_the_likeliest(votes: list[str]) -> None:
    item = belief()
    for label in votes:
        item.add_detection(label, BAD)
    assert 0.0 < item.class_error < 1.0
    assert votes.count(item.label) == max(votes.count(label) for label in votes)


@given(st.floats(-5, 5), st.integers(0, 200))
def test_an_item_that_is_searched_in_vain_becomes_ever_less_likely(existence: float, looks: int) -> None:
    item = belief(existence)
    before = item.existence_probability
    for _ in range(looks):
        item.add_miss(BAD)
    assert item.existence_probability <= before
    assert item.miss_probability == pytest.approx(0.2**looks, abs=1e-12)


def test_what_the_tool_has_met_exists_however_often_it_is_overlooked() -> None:
    item = belief()
    item.is_confirmed = True
    for _ in range(50):
        item.add_miss(BAD)
    assert item.existence_probability == 1.0


def test_agreeing_looks_reduce_the_standard_error_and_a_push_resets_it() -> None:
    item = record()
    for offset in (-0.01, 0.01, -0.01, 0.01):
        item.update_position(HERE + np.array([offset, 0, 0]), 0.013, is_unmoved=True)
    assert item.position == pytest.approx(HERE)
    assert item.standard_error == pytest.approx(0.013 / 2)
    item.update_position(HERE + np.array([0.05, 0, 0]), 0.013, is_unmoved=False)
    assert item.position[0] == pytest.approx(0.55)
    assert item.standard_error == 0.013
    assert item.first_position == pytest.approx(HERE), "where it was before it was moved"


@pytest.mark.parametrize(
    ("spread", "new", "allowed"),
    [(0.001, 0.001, 0.025), (0.006, 0.008, 0.035), (0.013, 0.013, 0.05), (math.inf, 0.013, 0.05)],
)
def test_the_gate_is_as_wide_as_the_measurements_scatter(spread: float, new: float, allowed: float) -> None:
    item = record()
    item.standard_error = spread
    observation = Observation(Detection("cube", 0.9, (0, 0, 1, 1)), HERE, new, 0.0)
    assert compute_association_distance(item, observation, 0.025) == pytest.approx(allowed)


def test_a_target_has_time_and_yaw_of_its_last_detection() -> None:
    item = record()
    yaw = Yaw(0.5, 0.01)
    frame = take_frame(7)
    observation = Observation(Detection("cube", 0.9, (0, 0, 1, 1)), HERE, 0.001, frame.stamp, yaw=yaw)
    item.store(observation, frame, 0.0, is_unmoved=True)
    assert (item.target.stamp, item.target.yaw) == (7.0, yaw)
    pose = item.target.pose_at(9.0)
    assert np.allclose(pose.rotation, rotate_about_z(yaw.angle))
    assert np.array_equal(pose.position, HERE)


def measure_yaws(*yaws: Yaw | None, unmoved: bool = True) -> ItemRecord:
    item = record()
    for yaw in yaws:
        seen = Observation(Detection("cube", 0.9, (0, 0, 1, 1)), HERE, 0.001, 0.0, yaw=yaw)
        item.store(seen, take_frame(0), 0.0, is_unmoved=unmoved)
    return item


@pytest.mark.parametrize(
    ("yaws", "expected"),
    [
        ([Yaw(0.1, 0.02, 4), Yaw(0.16, 0.02, 4)], Yaw(0.13, 0.02, 4)),
        ([Yaw(0.1, 0.02, 4), Yaw(0.1, 0.02, 4), Yaw(0.16, 0.02, 4)], Yaw(0.12, 0.02, 4)),
        ([Yaw(0.1, 0.01, 4), Yaw(0.2, 0.03, 4)], Yaw(0.11, 0.01, 4)),
        ([Yaw(0.77, 0.02, 4), Yaw(-0.77, 0.02, 4)], Yaw(math.pi / 4, 0.02, 4)),
        ([Yaw(0.1, 0.02, 2), Yaw(0.1 + 0.04 + math.pi, 0.02, 1)], Yaw(0.1 + 0.02 + math.pi, 0.02, 1)),
        ([Yaw(0.1, 0.02, 1), Yaw(0.1 + 0.04 - math.pi, 0.02, 2)], Yaw(0.12, 0.02, 1)),
        ([Yaw(0.1, 0.02, 4), None], Yaw(0.1, 0.02, 4)),
        ([Yaw(0.1, 0.02, 4), Yaw(0.25, 0.02, 4)], Yaw(0.25, 0.02, 4)),
        ([None, Yaw(0.1, 0.02, 4)], Yaw(0.1, 0.02, 4)),
    ],
)
def test_yaws_of_an_unmoved_item_are_averaged_unless_they_contradict(
    yaws: list[Yaw | None], expected: Yaw
) -> None:
    assert measure_yaws(*yaws).yaw == pytest.approx(expected)


def test_a_move_forgets_the_yaw() -> None:
    old = Yaw(0.1, 0.02, 4)
    new = Yaw(0.12, 0.02, 4)
    assert measure_yaws(old, new, unmoved=False).yaw == new
    assert measure_yaws(old, None, unmoved=False).yaw is None


STD = 0.05
LIGHT = ObjectClass("cube", 0.05, 0.0354, mass=0.05, mass_std=0.0)
HEAVY = ObjectClass("full_cube", 0.05, 0.0354, mass=0.20, mass_std=0.0, looks_like="cube")
BALL = ObjectClass("ball", 0.05, 0.03, mass=0.20, mass_std=0.0)
CLASSES = {each.label: each for each in (LIGHT, HEAVY, BALL)}
CUBE = ("cube", 0.5, 0.0)


def seen_belief() -> Belief:
    belief = Belief("cube", 0.0)
    belief.add_detection("cube", GOOD)
    return belief


def weigh(belief: Belief, weight: float) -> None:
    label_map = {label: each.detected_label for label, each in CLASSES.items()}
    belief.add_weighing(compute_weight_log_ratios(weight, STD, CLASSES), label_map)


def seen_bench(classes: dict[str, ObjectClass] = CLASSES) -> Bench:
    bench = Bench(classes=classes)
    for _ in range(3):
        bench.look(CUBE)
    bench.ledger.record_grasp("cube-1")
    return bench


def test_the_ratio_is_that_of_a_normal_and_a_uniform_distribution() -> None:
    ratios = compute_weight_log_ratios(0.05 * GRAVITY + 2 * STD, STD, CLASSES)
    density = math.exp(-2.0) / (STD * math.sqrt(2 * math.pi))
    assert ratios["cube"] == pytest.approx(math.log(density / 0.1))


@pytest.mark.parametrize("weight", [0.5 * GRAVITY, -50.0, 1e4])
def test_a_weight_far_from_all_classes_leaves_no_certain_class(weight: float) -> None:
    belief = seen_belief()
    weigh(belief, weight)
    assert belief.class_error == pytest.approx(1.0)


def test_the_heavy_one_of_two_that_look_alike_is_found_out_and_the_class_stays_as_certain() -> None:
    belief = seen_belief()
    before = belief.class_error
    weigh(belief, 0.20 * GRAVITY)
    assert (belief.label, belief.detected_label) == ("full_cube", "cube")
    assert belief.class_error < before
    assert belief.confusion_p_value == 1.0


def test_looks_after_a_weighing_are_evidence_for_both_classes() -> None:
    belief = seen_belief()
    weigh(belief, 0.20 * GRAVITY)
    gap = belief.log_likelihoods["full_cube"] - belief.log_likelihoods["cube"]
    belief.add_detection("cube", GOOD)
    assert belief.log_likelihoods["full_cube"] - belief.log_likelihoods["cube"] == pytest.approx(gap)
    assert (belief.label, belief.look_count) == ("full_cube", 2)


def test_a_weight_of_two_classes_that_weigh_the_same_leaves_the_class_uncertain() -> None:
    twin = ObjectClass("twin", 0.05, 0.0354, mass=0.05, mass_std=0.0, looks_like="cube")
    bench = seen_bench({"cube": LIGHT, "twin": twin})
    contradiction = bench.ledger.record_weight("cube-1", 0.05 * GRAVITY, STD)
    assert contradiction == "it weighs 0.49 N; expected: cube 0.49 N or twin 0.49 N"


@pytest.mark.parametrize(("deviation", "fits"), [(3.5, True), (-3.5, True), (5.0, False), (-5.0, False)])
def test_a_weight_that_no_class_has_is_a_contradiction_after_any_number_of_looks(
    deviation: float, fits: bool
) -> None:
    bench = seen_bench()
    for _ in range(20):
        bench.ledger.records[0].belief.add_detection("cube", GOOD)
    weight = 0.05 * GRAVITY + deviation * STD
    assert (bench.ledger.record_weight("cube-1", weight, STD) == "") is fits


def test_an_item_that_was_weighed_and_dropped_is_found_again_with_its_class() -> None:
    bench = seen_bench()
    assert bench.ledger.record_weight("cube-1", 0.20 * GRAVITY, STD) == ""
    bench.ledger.record_drop("cube-1")
    for _ in range(3):
        (target,) = bench.look(("cube", 0.55, 0.1))
    assert (target.item, target.label) == ("cube-1", "full_cube")
    assert bench.ledger.is_certain("cube-1")
