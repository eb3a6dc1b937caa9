"""Figures about a detector, on images whose truth is known, and the error rates for the ledger."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from executive.errors import NoDepth
from executive.training.evaluate import evaluate
from executive.training.metrics import ClassMetrics, CountedRate, MeasuredErrorRates


@pytest.fixture
def both(sample):
    """The answer of a perfect detector."""
    cube, duck = sample.boxes
    return ("cube", 0.9, cube), ("duck", 0.8, duck)


@pytest.fixture
def off(sample):
    """An answer whose only box is one pixel off."""
    left, top, right, bottom = sample.boxes[0]
    return [("cube", 0.9, (left + 1, top, right + 1, bottom))]


def list_counts(measured):
    rates = measured.reliability
    return [
        (rate.events, rate.trials) for rate in (rates.miss_rate, rates.confusion_rate, rates.false_detections)
    ]


def test_a_perfect_detector_is_perfect(saying, sample, both):
    measured = evaluate(saying(both), [sample])
    assert (measured.images, measured.objects, measured.threshold) == (1, 2, 0.5)
    assert (measured.precision, measured.recall) == (1, 1)
    assert measured.map50 == pytest.approx(1, abs=1e-3)
    assert (measured.centre.worst, measured.position.worst) == (0, pytest.approx(0, abs=1e-9))
    plain = measured.to_dict()
    perfect = {"objects": 1, "precision": 1, "recall": 1}
    assert plain["by_class"] == {"cube": perfect, "duck": perfect}
    bounds = {"miss_rate": 0.78, "confusion_rate": 0.78, "false_detections": 3.0}
    assert plain["reliability"]["rates"] == {**bounds, "jitter": 0.01, "repeated": 0.5, "bias": 0.0}
    assert plain["by_count"] == {2: {"objects": 2, "missed": 0, "confused": 0, "false_detections": 0}}


def test_a_miss_lowers_recall_and_a_phantom_lowers_precision(saying, sample, both):
    missing = evaluate(saying(both[:1]), [sample])
    assert (missing.precision, missing.recall) == (1, 0.5)
    imagining = evaluate(saying((*both, ("duck", 0.7, (150.0, 200.0, 180.0, 230.0)))), [sample])
    assert (imagining.precision, imagining.recall) == (2 / 3, 1)
    assert imagining.by_class["duck"] == ClassMetrics(1, 0.5, 1)
    assert imagining.confusion["nothing"] == {"cube": 0, "duck": 1}
    assert list_counts(imagining) == [(0, 2), (0, 2), (1, 1)]


def test_a_wrong_class_at_the_right_position_counts_as_miss_and_false_detection(saying, sample, both):
    measured = evaluate(saying((("duck", 0.9, sample.boxes[0]), both[1])), [sample])
    assert (measured.precision, measured.recall) == (0.5, 0.5)
    assert measured.confusion == {"cube": {"duck": 1}, "duck": {"duck": 1}}
    assert list_counts(measured) == [(0, 2), (1, 2), (0, 1)]


def test_what_is_ignored_or_under_the_threshold_does_not_count(saying, sample, both):
    half_hidden = evaluate(saying((*both, ("cube", 0.9, sample.ignored_boxes[0]))), [sample])
    assert (half_hidden.precision, half_hidden.recall, half_hidden.objects) == (1, 1, 2)
    doubtful = saying((("cube", 0.4, sample.boxes[0]), both[1]))
    measured = evaluate(doubtful, [sample])
    assert (measured.recall, measured.map50) == (0.5, pytest.approx(1, abs=1e-3))
    lower = evaluate(doubtful, [sample], threshold=0.3)
    assert (lower.recall, lower.threshold) == (1, 0.3)


def test_a_pixel_is_as_far_in_the_world_as_the_camera_says_and_less_of_a_magnified_part(
    saying, sample, off, knowing
):
    measured = evaluate(saying(off), [sample])
    assert (measured.centre.worst, measured.position.worst) == pytest.approx((1, 1000 / 256))
    part = knowing(part=[64, 64, 192, 192], positions=[[-51.5 / 256, 51.5 / 256, 0]] * 2)
    measured = evaluate(saying(off), [part])
    assert (measured.centre.worst, measured.position.worst) == pytest.approx((1, 1000 / 512))
    assert measured.reliability.jitter == pytest.approx(np.sqrt(0.5**2 / 2))


def test_what_is_cut_off_or_half_hidden_says_nothing_about_position_and_rates(saying, sample, both, knowing):
    at_edge = (0.0, 10.0, 20.0, 40.0)
    cut = replace(sample, labels=("cube",), boxes=(at_edge,))
    measured = evaluate(saying([("cube", 0.9, at_edge)]), [cut])
    assert (measured.centre.worst, measured.position, list_counts(measured)[0]) == (0, None, (0, 0))
    assert list_counts(evaluate(saying(both), [replace(sample, region=(10, 0, 256, 256))]))[0] == (0, 1)
    hidden = evaluate(saying(both[1:]), [knowing(visible_fraction=[0.6, 1.0])])
    assert (hidden.recall, list_counts(hidden)[0]) == (0.5, (0, 1))


def test_a_detector_that_is_unavailable_is_counted_apart(saying, sample, both):
    measured = evaluate(saying(both, "the server is gone", both), [sample] * 4)
    assert (measured.images, measured.unavailable, measured.why) == (4, 1, "the server is gone")
    assert (measured.objects, measured.recall, measured.answered_by) == (6, 1, {"scripted": 3})
    # The first answer does not count.
    assert measured.latency.median == pytest.approx(35)
    assert measured.reliability.false_detections.trials == 3


def test_without_answers_there_are_zeros_and_no_spreads(saying, sample):
    silent, unasked = evaluate(saying("the server is gone"), [sample]), evaluate(saying([]), [])
    assert (silent.images, silent.unavailable, unasked.images) == (1, 1, 0)
    for one in (silent, unasked):
        assert (one.objects, one.precision, one.recall, one.map50) == (0, 0, 0, 0)
        assert one.reliability is one.latency is one.centre is None
    assert evaluate(saying(""), [sample]).why == "Unavailable('')"


def test_the_cells_localizer_is_held_against_the_true_middle(saying, sample, both):
    class Beside:
        def locate(self, detection, frame):
            if detection.label == "duck":
                raise NoDepth("no depth there")
            return np.add(sample.truth["centres"][0], [0.003, 0, 0.004])

    measured = evaluate(saying(both), [sample], localizer=Beside())
    assert measured.localized.median == pytest.approx(5)


def measure(full_view_count, missed, confused, invented, looks, jitter):
    return MeasuredErrorRates(
        CountedRate.estimate_proportion(missed, full_view_count),
        CountedRate.estimate_proportion(confused, full_view_count - missed),
        CountedRate.estimate_mean_count(invented, looks), jitter, repeated=0.751, bias=0.00112,
    )  # fmt: skip


def test_the_rates_for_the_ledger_are_upper_bounds_rounded_up():
    stored = measure(1344, 0, 2, 1, 300, 0.432).rates
    assert tuple(stored.model_dump().values()) == (0.0023, 0.0047, 0.016, 0.44, 0.76, 0.0012)


@pytest.mark.parametrize(
    ("full_view_count", "missed", "invented", "expected"),
    [
        (1344, 0, 0, (1 - 0.05 ** (1 / 1344), 0.029957)),
        (13, 2, 10, (0.410099, 0.169622)),
        (5, 5, 400, (1.0, 4.344968)),
    ],
)
def test_the_bounds_are_those_of_the_tables(full_view_count, missed, invented, expected):
    """Clopper and Pearson's, and Garwood's: half the 95 % quantile of chi-squared with 2 k + 2 degrees."""
    found = measure(full_view_count, missed, 0, invented, 100, 0.1)
    assert (found.miss_rate.bound, found.false_detections.bound) == pytest.approx(expected, rel=1e-4)
