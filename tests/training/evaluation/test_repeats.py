"""Errors that a second look from the same pose repeats, and random and systematic errors of a place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from executive.training.evaluate import evaluate


@pytest.fixture
def twice(sample):
    """The image, taken twice."""
    return replace(sample, repeated_image=sample.image)


def test_a_miss_and_a_wrong_class_that_come_again_are_repeated(saying, twice, sample):
    cube, duck = sample.boxes
    wrong = [("sphere", 0.9, cube)]
    measured = evaluate(saying(wrong, wrong), [twice])
    # Two errors, a miss and a confusion, both repeated: (2 + 1) / (2 + 2).
    assert measured.reliability.repeated == 0.75
    healed = evaluate(saying(wrong, [("cube", 0.9, cube), ("duck", 0.9, duck)]), [twice])
    assert healed.reliability.repeated == 0.25


def test_a_false_detection_is_repeated_at_its_place_only(saying, twice, sample):
    right = [("cube", 0.9, sample.boxes[0]), ("duck", 0.9, sample.boxes[1])]
    here, there = ("duck", 0.9, (150.0, 200.0, 180.0, 230.0)), ("duck", 0.9, (10.0, 200.0, 40.0, 230.0))
    assert evaluate(saying([*right, here], [*right, here]), [twice]).reliability.repeated == pytest.approx(
        2 / 3
    )
    assert evaluate(saying([*right, here], [*right, there]), [twice]).reliability.repeated == pytest.approx(
        1 / 3
    )


def test_an_offset_in_both_looks_is_systematic_and_one_between_them_is_random(saying, twice, sample):
    class Plain:
        def locate(self, detection, frame):
            del frame
            x, y = np.array(detection.centre) - (25.0, 25.0)
            return np.array([x / 1000, y / 1000, 0.0]) + sample.truth["centres"][0]

    left, top, right, bottom = sample.boxes[0]
    first = [("cube", 0.9, (left + 2, top, right + 2, bottom))]
    second = [("cube", 0.9, (left + 2, top + 1, right + 2, bottom + 1))]
    same = evaluate(saying(first, first), [twice], localizer=Plain()).reliability
    assert (same.jitter, same.bias) == (0, pytest.approx(0.002 / np.sqrt(2)))
    other = evaluate(saying(first, second), [twice], localizer=Plain()).reliability
    assert other.jitter == pytest.approx(np.sqrt(0.5 / 2))
