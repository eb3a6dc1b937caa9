"""Figures about a detector, on images whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest

from executive.messages import Detection
from executive.vision.evaluate import Spread, evaluate
from executive.vision.samples import LabelledImage

IMAGE = np.zeros((256, 256, 3), np.uint8)
CUBE, DUCK, HALF_HIDDEN = (10.0, 10.0, 40.0, 40.0), (100.0, 100.0, 140.0, 130.0), (200.0, 20.0, 230.0, 50.0)
TRUTH = {
    # One metre above the table, looking down; 256 pixels of focal length: one pixel is 1/256 m.
    "matrix": [[256.0, 0, 128], [0, 256.0, 128], [0, 0, 1]],
    "X_WC": [0, 0, 1, 1, 0, 0, 0],
    "part": [0, 0, 256, 256],
    "positions": [[(25 - 128) / 256, -(25 - 128) / 256, 0.0], [(120 - 128) / 256, -(115 - 128) / 256, 0.0]],
}
SAMPLE = LabelledImage("a.jpg", IMAGE, ("cube", "duck"), (CUBE, DUCK), (HALF_HIDDEN,), TRUTH)


class Always:
    """A model that gives the same answer to every image."""

    labels = ("cube", "duck")

    def __init__(self, *found):
        self.found = [Detection(label, confidence, box) for label, confidence, box in found]

    def detect(self, image, floor):
        return [one for one in self.found if one.confidence >= floor]


def test_a_perfect_model_is_perfect():
    measured = evaluate(Always(("cube", 0.9, CUBE), ("duck", 0.8, DUCK)), [SAMPLE], 0.5)
    assert (measured.images, measured.objects) == (1, 2)
    assert (measured.precision, measured.recall) == (1, 1)
    assert measured.map50 == pytest.approx(1, abs=1e-3)
    assert measured.centre.worst == 0
    assert measured.position.worst == pytest.approx(0, abs=1e-9)
    assert measured.as_dict()["recall_by_class"] == {"cube": 1, "duck": 1}


def test_a_miss_lowers_recall_and_a_phantom_lowers_precision():
    missing = evaluate(Always(("cube", 0.9, CUBE)), [SAMPLE], 0.5)
    assert (missing.precision, missing.recall) == (1, 0.5)
    phantom = (150.0, 200.0, 180.0, 230.0)
    imagining = evaluate(
        Always(("cube", 0.9, CUBE), ("duck", 0.8, DUCK), ("duck", 0.7, phantom)), [SAMPLE], 0.5
    )
    assert imagining.precision == pytest.approx(2 / 3)
    assert imagining.recall == 1


def test_the_right_place_with_the_wrong_class_is_both_a_miss_and_a_phantom():
    measured = evaluate(Always(("duck", 0.9, CUBE), ("duck", 0.8, DUCK)), [SAMPLE], 0.5)
    assert (measured.precision, measured.recall) == (0.5, 0.5)
    assert measured.recall_by_class == {"cube": 0, "duck": 1}


def test_an_object_found_twice_counts_once():
    measured = evaluate(Always(("cube", 0.9, CUBE), ("cube", 0.8, CUBE), ("duck", 0.8, DUCK)), [SAMPLE], 0.5)
    assert measured.recall == 1
    assert measured.precision == pytest.approx(2 / 3)


def test_half_hidden_objects_may_be_found_or_not():
    finding = Always(("cube", 0.9, CUBE), ("duck", 0.8, DUCK), ("cube", 0.9, HALF_HIDDEN))
    measured = evaluate(finding, [SAMPLE], 0.5)
    assert (measured.precision, measured.recall, measured.objects) == (1, 1, 2)


def test_what_is_under_the_threshold_is_not_counted():
    measured = evaluate(Always(("cube", 0.4, CUBE), ("duck", 0.8, DUCK)), [SAMPLE], 0.5)
    assert measured.recall == 0.5


def test_a_box_one_pixel_off_is_as_far_off_in_the_world_as_the_camera_says():
    left, top, right, bottom = CUBE
    measured = evaluate(Always(("cube", 0.9, (left + 1, top, right + 1, bottom))), [SAMPLE], 0.5)
    assert measured.centre.worst == pytest.approx(1)
    assert measured.position.worst == pytest.approx(1000 / 256)


def test_an_object_cut_off_by_the_images_border_says_nothing_about_position():
    at_edge = (0.0, 10.0, 20.0, 40.0)
    sample = LabelledImage("b.jpg", IMAGE, ("cube",), (at_edge,), (), TRUTH)
    measured = evaluate(Always(("cube", 0.9, at_edge)), [sample], 0.5)
    assert measured.centre is not None
    assert measured.position is None


def test_no_images_give_zeros_and_no_spreads():
    measured = evaluate(Always(), [], 0.5)
    assert (measured.images, measured.precision, measured.recall, measured.map50) == (0, 0, 0, 0)
    assert measured.centre is None


def test_a_spread_names_its_quantiles():
    spread = Spread.of(list(range(101)))
    assert (spread.median, spread.p95, spread.p99, spread.worst) == (50, 95, 99, 100)
    assert Spread.of([]) is None
