"""Which detection is which object."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executive.messages import Detection
from executive.vision.evaluation.matching import is_ignored, match


@pytest.fixture
def matched(sample):
    """A function that matches detections with the image and returns object and rightness of each."""

    def match_all(*found):
        detections = [Detection(label, confidence, box) for label, confidence, box in found]
        return [(one.detection.confidence, one.number, one.right) for one in match(detections, sample)]

    return match_all


def test_an_object_found_twice_is_the_more_confident_one(sample, matched):
    cube, _ = sample.boxes
    assert matched(("cube", 0.7, cube), ("cube", 0.9, cube)) == [(0.9, 0, True), (0.7, None, False)]


def test_the_right_class_takes_an_object_before_a_more_confident_wrong_one(sample, matched):
    cube, _ = sample.boxes
    assert matched(("duck", 0.9, cube), ("cube", 0.6, cube)) == [(0.9, None, False), (0.6, 0, True)]


def test_an_object_that_nothing_of_its_class_takes_is_taken_for_another(sample, matched):
    _, duck = sample.boxes
    assert matched(("cube", 0.9, duck)) == [(0.9, 1, False)]


def test_less_than_half_an_overlap_is_nothing(sample, matched):
    left, top, right, bottom = sample.boxes[0]
    assert matched(("cube", 0.9, (left + 11, top, right + 11, bottom))) == [(0.9, None, False)]
    assert matched(("cube", 0.9, (left + 9, top, right + 9, bottom))) == [(0.9, 0, True)]


def test_an_ignored_object_is_one_that_a_box_fits_better_than_any_other(sample):
    (half_hidden,) = sample.ignored
    assert is_ignored(Detection("cube", 0.9, half_hidden), sample)
    assert not is_ignored(Detection("cube", 0.9, sample.boxes[0]), sample)
    left, top, right, bottom = sample.boxes[0]
    behind = replace(sample, ignored=((left + 3, top, right + 3, bottom),))
    assert not is_ignored(Detection("cube", 0.9, sample.boxes[0]), behind)
