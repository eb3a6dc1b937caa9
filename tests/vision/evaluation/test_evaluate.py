"""Figures about a detector, on images whose truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from executive.errors import NoDepth
from executive.vision.evaluation.evaluate import evaluate
from executive.vision.evaluation.figures import ClassFigures, Spread
from executive.vision.evaluation.misses import WorstMisses


@pytest.fixture
def both(sample):
    """The answer of a perfect detector."""
    cube, duck = sample.boxes
    return ("cube", 0.9, cube), ("duck", 0.8, duck)


def moved(box, pixels):
    left, top, right, bottom = box
    return left + pixels, top, right + pixels, bottom


def test_a_perfect_detector_is_perfect(saying, sample, both):
    measured = evaluate(saying(both), [sample])
    assert (measured.images, measured.objects, measured.threshold) == (1, 2, 0.5)
    assert (measured.precision, measured.recall) == (1, 1)
    assert measured.map50 == pytest.approx(1, abs=1e-3)
    assert measured.centre.worst == 0
    assert measured.position.worst == pytest.approx(0, abs=1e-9)
    assert measured.by_class == {"cube": ClassFigures(1, 1, 1), "duck": ClassFigures(1, 1, 1)}


def test_a_miss_lowers_recall_and_a_phantom_lowers_precision(saying, sample, both):
    missing = evaluate(saying(both[:1]), [sample])
    assert (missing.precision, missing.recall) == (1, 0.5)
    imagining = evaluate(saying((*both, ("duck", 0.7, (150.0, 200.0, 180.0, 230.0)))), [sample])
    assert imagining.precision == pytest.approx(2 / 3)
    assert imagining.recall == 1
    assert imagining.by_class["duck"] == ClassFigures(1, 0.5, 1)
    assert imagining.confusion["nothing"] == {"cube": 0, "duck": 1}


def test_the_right_place_with_the_wrong_class_is_wrong_both_ways_and_told_apart(saying, sample, both):
    measured = evaluate(saying((("duck", 0.9, sample.boxes[0]), both[1])), [sample])
    assert (measured.precision, measured.recall) == (0.5, 0.5)
    assert measured.confusion == {"cube": {"duck": 1}, "duck": {"duck": 1}}
    stated = measured.reliability
    assert (stated.misses.events, stated.misses.trials) == (0, 2)
    assert (stated.confused.events, stated.confused.trials) == (1, 2)
    assert stated.invented.events == 0


def test_half_hidden_objects_may_be_found_or_not(saying, sample, both):
    measured = evaluate(saying((*both, ("cube", 0.9, sample.ignored[0]))), [sample])
    assert (measured.precision, measured.recall, measured.objects) == (1, 1, 2)


def test_what_is_under_the_threshold_counts_for_the_average_precision_only(saying, sample, both):
    doubtful = (("cube", 0.4, sample.boxes[0]), both[1])
    measured = evaluate(saying(doubtful), [sample])
    assert measured.recall == 0.5
    assert measured.map50 == pytest.approx(1, abs=1e-3)
    lower = evaluate(saying(doubtful), [sample], threshold=0.3)
    assert (lower.recall, lower.threshold) == (1, 0.3)


def test_classes_that_are_on_no_image_leave_the_average_precision_alone(saying, sample, both):
    measured = evaluate(saying((*both, ("boat", 0.9, (0.0, 150.0, 60.0, 250.0)))), [sample])
    assert measured.map50 == pytest.approx(1, abs=1e-3)
    assert measured.precision == pytest.approx(2 / 3)


def test_a_box_one_pixel_off_is_as_far_off_in_the_world_as_the_camera_says(saying, sample):
    measured = evaluate(saying([("cube", 0.9, moved(sample.boxes[0], 1))]), [sample])
    assert measured.centre.worst == pytest.approx(1)
    assert measured.position.worst == pytest.approx(1000 / 256)


def test_a_pixel_of_a_magnified_part_is_less_of_the_frame(saying, sample, knowing):
    part = knowing(part=[64, 64, 192, 192], positions=[[-51.5 / 256, 51.5 / 256, 0]] * 2)
    measured = evaluate(saying([("cube", 0.9, moved(sample.boxes[0], 1))]), [part])
    assert measured.centre.worst == pytest.approx(1)
    assert measured.position.worst == pytest.approx(1000 / 512)
    assert measured.reliability.jitter == pytest.approx(np.sqrt(0.5**2 / 2))


def test_an_object_cut_off_by_the_images_border_says_nothing_about_position(saying, sample):
    at_edge = (0.0, 10.0, 20.0, 40.0)
    cut = replace(sample, labels=("cube",), boxes=(at_edge,))
    measured = evaluate(saying([("cube", 0.9, at_edge)]), [cut])
    assert measured.centre is not None
    assert measured.position is None
    assert measured.reliability.misses.trials == 0


def test_what_lies_at_the_border_of_the_searched_area_is_not_in_full_view(saying, sample, both):
    measured = evaluate(saying(both), [replace(sample, area=(10, 0, 256, 256))])
    assert measured.reliability.misses.trials == 1


def test_an_object_half_behind_another_is_demanded_but_not_held_against_the_detector(saying, sample, knowing):
    hidden = knowing(visible_fraction=[0.6, 1.0])
    measured = evaluate(saying([("duck", 0.8, sample.boxes[1])]), [hidden])
    assert measured.recall == 0.5
    assert (measured.reliability.misses.events, measured.reliability.misses.trials) == (0, 1)


def test_a_detector_that_is_unavailable_is_counted_apart(saying, sample, both):
    measured = evaluate(saying(both, "the server is gone", both), [sample] * 4)
    assert (measured.images, measured.unavailable, measured.why) == (4, 1, "the server is gone")
    assert (measured.objects, measured.recall) == (6, 1)
    assert measured.answered_by == {"scripted": 3}
    assert measured.reliability.invented.trials == 3


def test_a_detector_that_never_answers_has_no_figures(saying, sample):
    measured = evaluate(saying("the server is gone"), [sample])
    assert (measured.unavailable, measured.objects, measured.recall) == (1, 0, 0)
    assert measured.reliability is None
    assert measured.latency is None


def test_the_first_look_does_not_count_for_the_latency(saying, sample, both):
    assert evaluate(saying(both), [sample] * 3).latency.median == pytest.approx(25)
    assert evaluate(saying(both), [sample]).latency.median == pytest.approx(10)


def test_the_cells_localizer_is_held_against_the_true_middle(saying, sample, both):
    class Beside:
        def locate(self, detection, frame):
            if detection.label == "duck":
                raise NoDepth("no depth there")
            return np.add(sample.truth["centres"][0], [0.003, 0, 0.004])

    measured = evaluate(saying(both), [sample], localizer=Beside())
    assert measured.localized.median == pytest.approx(5)


def test_the_worst_misses_are_gathered(saying, sample, both):
    worst = WorstMisses()
    evaluate(saying(both[:1]), [sample], worst=worst)
    assert [miss.text for miss in worst.kept] == ["duck overlooked", "cube off by 0.0 px"]


def test_no_images_give_zeros_and_no_spreads(saying):
    measured = evaluate(saying([]), [])
    assert (measured.images, measured.precision, measured.recall, measured.map50) == (0, 0, 0, 0)
    assert measured.centre is None
    assert measured.reliability is None


def test_figures_are_plain_values_with_what_a_cell_file_should_state(saying, sample, both):
    plain = evaluate(saying(both), [sample]).as_dict()
    assert plain["by_class"]["cube"] == {"objects": 1, "precision": 1, "recall": 1}
    assert plain["reliability"]["misses"]["events"] == 0
    stated = {"misses": 0.78, "confused": 0.78, "invented": 3.0, "jitter": 0.01}
    assert plain["reliability"]["stated"] == stated


def test_a_spread_names_its_quantiles():
    spread = Spread.of(list(range(101)))
    assert (spread.median, spread.p95, spread.p99, spread.worst) == (50, 95, 99, 100)
    assert Spread.of([]) is None
