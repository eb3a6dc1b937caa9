"""A detector that errs on purpose."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from executive.cell.config import DetectorConfig
from executive.cell.frame import Detection
from executive.perception.detectors.detector_registry import DetectorContext
from executive.perception.detectors.noisy import NoisyDetector

CLASSES = ("cube", "sphere", "duck")
LOOKS = 1000
TABLE = (192, 100, 448, 356)
THINGS = tuple(
    Detection(label, 0.9, (x, 200.0, x + 20, 220.0))
    for label, x in zip(CLASSES, (210, 300, 400), strict=True)
)
VIEWS = {"table": TABLE, "full": (0, 0, 640, 480)}
KNOWN = SimpleNamespace(detect=lambda frame, view: THINGS)
"""A detector that always sees the same three things."""


def answers(seed=1, view="table", **errors):
    none = {"miss_rate": 1e-9, "confusion_rate": 1e-9, "false_detections": 1e-9, "jitter": 1e-9}
    config = DetectorConfig(kind="noisy", of="known", classes=list(CLASSES), **{**none, **errors})
    context = DetectorContext(
        "noisy", SimpleNamespace(get_view_box=lambda view: VIEWS[view]), Path(), seed, lambda name: KNOWN
    )
    detector = NoisyDetector.from_config(config, context)
    frames = [SimpleNamespace(id=number, image=np.zeros((480, 640, 3))) for number in range(LOOKS)]
    return [detector.detect(frame, view) for frame in frames]


def test_it_overlooks_as_many_as_it_says():
    share = 1 - np.mean([len(answer) for answer in answers(miss_rate=0.2)]) / len(THINGS)
    assert share == pytest.approx(0.2, abs=0.02)


def test_it_confuses_as_many_as_it_says_and_is_then_not_confident():
    found = [one for answer in answers(confusion_rate=0.1) for one in answer]
    wrong = [one for one in found if one.confidence != 0.9]
    assert len(wrong) / len(found) == pytest.approx(0.1, abs=0.015)
    assert max(one.confidence for one in wrong) <= 0.75
    assert all(abs(THINGS[CLASSES.index(one.label)].box[0] - one.box[0]) > 1 for one in wrong)


def test_its_boxes_are_off_by_as_much_as_it_says_and_keep_their_size():
    moved = {thing.label: thing.centre for thing in THINGS}
    found = [one for answer in answers(jitter=5.0) for one in answer]
    shifts = [np.subtract(one.centre, moved[one.label]) for one in found]
    assert np.std(shifts, axis=0) == pytest.approx([5.0, 5.0], rel=0.05)
    assert np.mean(shifts, axis=0) == pytest.approx([0.0, 0.0], abs=0.3)
    assert [one.box[2] - one.box[0] for one in found] == pytest.approx([20.0] * len(found))


@pytest.mark.parametrize(("view", "part"), VIEWS.items())
def test_what_it_invents_lies_in_the_searched_part(view, part):
    found = [one for answer in answers(false_detections=0.5, view=view) for one in answer]
    invented = [one for one in found if one.confidence != 0.9]
    assert len(invented) / LOOKS == pytest.approx(0.5, abs=0.06)
    centres = np.array([one.centre for one in invented])
    assert np.all(centres >= part[:2])
    assert np.all(centres <= part[2:])
    assert {one.label for one in invented} == set(CLASSES)


def test_it_errs_the_same_for_the_same_seed_and_otherwise_for_another():
    errors = {"miss_rate": 0.2, "confusion_rate": 0.1, "false_detections": 0.5, "jitter": 5.0}
    first = answers(seed=3, **errors)
    assert first == answers(seed=3, **errors)
    assert first != answers(seed=4, **errors)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"of": "eye", "classes": ["cube"]}, 'the cell has no detector "eye"; it has: noisy, known'),
        ({"classes": ["cube"]}, 'option "of" of a detector of kind noisy: field required'),
    ],
)
def test_the_cause_of_a_failed_construction_is_reported(options, sentence):
    wrong = DetectorConfig(kind="noisy", **options)
    others = {"noisy": wrong, "known": DetectorConfig(kind="embedded")}
    ((_, message),) = NoisyDetector.check(wrong, Path(), others)
    assert message.startswith(sentence)
