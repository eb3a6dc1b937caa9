"""Weight of an item as evidence about its class, among classes that look alike and others."""

from __future__ import annotations

import math

import pytest

from executive.cell.detection import ErrorRates
from executive.cell.objects import ObjectClass
from executive.geometry import GRAVITY
from executive.ledger.belief import Belief
from executive.perception.evidence import compute_weight_log_ratios
from tests.ledger.ledger_bench import Bench

STD = 0.05
LIGHT = ObjectClass("cube", 0.05, 0.0354, mass=0.05, mass_std=0.0)
HEAVY = ObjectClass("full_cube", 0.05, 0.0354, mass=0.20, mass_std=0.0, looks_like="cube")
BALL = ObjectClass("ball", 0.05, 0.03, mass=0.20, mass_std=0.0)
CLASSES = {each.label: each for each in (LIGHT, HEAVY, BALL)}
GOOD = ErrorRates(threshold=0.5, miss_rate=0.02, confusion_rate=0.0025, false_detections=0.02, jitter=0.7)
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


def test_a_class_that_looks_different_is_no_hypothesis() -> None:
    belief = Belief("ball", 0.0)
    belief.add_detection("ball", GOOD)
    weigh(belief, 0.05 * GRAVITY)
    assert belief.label == "ball"
    assert belief.class_error > 0.99


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


def test_a_second_weighing_with_the_same_error_leaves_the_class_as_uncertain() -> None:
    near = {
        "cube": LIGHT,
        "full_cube": ObjectClass("full_cube", 0.05, 0.0354, mass=0.06, mass_std=0.0, looks_like="cube"),
    }
    bench = seen_bench(near)
    answers = {bench.ledger.record_weight("cube-1", 0.058 * GRAVITY, STD) for _ in range(6)}
    assert answers == {"it weighs 0.57 N; expected: cube 0.49 N or full_cube 0.59 N"}
    assert set(bench.ledger.list_possible_labels("cube-1")) == {"cube", "full_cube"}
