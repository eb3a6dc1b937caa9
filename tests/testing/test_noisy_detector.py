"""A detector that errs on purpose."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from executive.cell_config import DetectorConfig
from executive.messages import Answer, Box, Detection, Frame, Reliability
from executive.mission.parse.cell_file import load_cell
from executive.mission.text.files import shipped_folder
from executive.testing.noisy_detector import NoisyDetector
from executive.vision.detectors.setting import Setting

CLASSES = ("cube", "sphere", "duck")
LOOKS = 1000
SURE = Reliability(threshold=0.5, misses=0.01, confused=0.01, invented=0.01, jitter=1.0)
THINGS = tuple(
    Detection(label, 0.9, (x, 200.0, x + 20, 220.0))
    for label, x in zip(CLASSES, (210, 300, 400), strict=True)
)


class Known:
    """A detector that always sees the same three things."""

    ready = True

    def request(self, frame: Frame, view: str) -> Known:
        return self

    def result(self) -> Answer:
        return Answer("known", THINGS, SURE)


def config(**errors: float) -> DetectorConfig:
    none = {"misses": 1e-9, "confused": 1e-9, "invented": 1e-9, "jitter": 1e-9}
    return DetectorConfig(kind="noisy", of="known", classes=list(CLASSES), **{**none, **errors})


def answers(seed: int = 1, view: str = "table", **errors: float) -> list[Answer]:
    camera = load_cell(shipped_folder() / "cells" / "overhead.yaml").cameras["overhead"]
    setting = Setting("noisy", camera, None, Path(), seed, lambda name: Known())  # type: ignore[arg-type, return-value]
    detector = NoisyDetector.from_config(config(**errors), setting)
    return [detector.request(frame(number), view).result() for number in range(LOOKS)]


def frame(number: int) -> Frame:
    image = np.zeros((480, 640, 3), np.uint8)
    return Frame(number, "eye", image, None, np.eye(3), None, 0.0, np.ones((480, 640), bool), 0)  # type: ignore[arg-type]


def test_without_errors_it_says_what_the_other_says_in_its_own_name() -> None:
    answer = answers()[0]
    assert answer.detector == "noisy"
    assert [one.label for one in answer.found] == list(CLASSES)


def test_it_tells_the_figures_by_which_it_errs() -> None:
    assert answers(misses=0.2, jitter=5.0)[0].reliability.misses == 0.2


def test_it_overlooks_as_many_as_it_says() -> None:
    share = 1 - np.mean([len(answer.found) for answer in answers(misses=0.2)]) / len(THINGS)
    assert share == pytest.approx(0.2, abs=0.02)


def test_it_confuses_as_many_as_it_says_and_is_then_not_confident() -> None:
    found = [one for answer in answers(confused=0.1) for one in answer.found]
    wrong = [one for one in found if one.confidence != 0.9]
    assert len(wrong) / len(found) == pytest.approx(0.1, abs=0.015)
    assert max(one.confidence for one in wrong) <= 0.75
    assert all(THINGS[CLASSES.index(one.label)].box != one.box for one in wrong)


def test_its_boxes_are_off_by_as_much_as_it_says_and_keep_their_size() -> None:
    shifts = [
        np.subtract(one.centre, thing.centre)
        for answer in answers(jitter=5.0)
        for one in answer.found
        for thing in THINGS
        if one.label == thing.label
    ]
    assert np.std(shifts, axis=0) == pytest.approx([5.0, 5.0], rel=0.05)
    assert np.mean(shifts, axis=0) == pytest.approx([0.0, 0.0], abs=0.3)


@pytest.mark.parametrize(("view", "part"), [("table", (192, 100, 448, 356)), ("full", (0, 0, 640, 480))])
def test_what_it_invents_lies_in_the_searched_part(view: str, part: Box) -> None:
    invented = [
        one for answer in answers(invented=0.5, view=view) for one in answer.found if one.confidence != 0.9
    ]
    assert len(invented) / LOOKS == pytest.approx(0.5, abs=0.06)
    centres = np.array([one.centre for one in invented])
    assert np.all(centres >= part[:2])
    assert np.all(centres <= part[2:])
    assert {one.label for one in invented} == set(CLASSES)


def test_it_errs_the_same_for_the_same_seed_and_otherwise_for_another() -> None:
    errors = {"misses": 0.2, "confused": 0.1, "invented": 0.5, "jitter": 5.0}
    assert answers(seed=3, **errors) == answers(seed=3, **errors)
    assert answers(seed=3, **errors) != answers(seed=4, **errors)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"of": "eye", "classes": ["cube"]}, 'the cell has no detector "eye"; it has: noisy, known'),
        ({"classes": ["cube"]}, 'option "of" of a detector of kind noisy: field required'),
    ],
)
def test_what_keeps_it_from_being_built_is_told(options: dict, sentence: str) -> None:
    wrong = DetectorConfig(kind="noisy", **options)
    others = {"noisy": wrong, "known": DetectorConfig(kind="embedded")}
    ((_, told),) = NoisyDetector.check(wrong, Path(), others)
    assert told.startswith(sentence)
