"""Asking a detector of a cell file outside of any run, with fewer processor cores if need be."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from executive.cell.config import DetectorConfig
from executive.cell.detection import Answer, Detection
from executive.errors import Unavailable
from executive.perception.detectors.views import list_regions
from executive.training.evaluation import evaluate
from executive.training.evaluation.evaluate import WHOLE_IMAGE_CAMERA, CellDetector

CONFIGS = {"eye": DetectorConfig(kind="embedded", threshold=0.6)}
FOUND = tuple(Detection(label, 0.9, (1.0, 2.0, 3.0, 4.0)) for label in ("cube", "boat"))
ANSWER = Answer("eye", FOUND, CONFIGS["eye"].error_rates)


class Delayed:
    """Gives its answer 0.3 s after it was asked; one without an answer never does."""

    def __init__(self, camera, clock, answer):
        self.camera, self.clock, self.answer = camera, clock, answer
        self.stamps, self.views, self.closed = [], [], False

    def request(self, frame, view):
        self.stamps.append(frame.stamp)
        self.views.append(view)
        return self

    @property
    def ready(self):
        return self.answer is not None and self.clock.now >= self.stamps[-1] + 0.3

    def result(self):
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer

    def close(self):
        self.closed = True


@pytest.fixture
def build(monkeypatch):
    """Makes a detector of a cell that gives an answer, and returns it with what stands behind it."""

    def build(answer=ANSWER, **options):
        behind = SimpleNamespace()

        def build_detectors(configs, *, camera, clock, base, seed):
            behind.eye = Delayed(camera, clock, answer)
            return vars(behind)

        monkeypatch.setattr(evaluate, "build_detectors", build_detectors)
        return CellDetector(CONFIGS, "eye", base=Path(), **options), behind.eye

    return build


@pytest.fixture
def frame(sample):
    return sample.to_frame(1)


def test_an_answer_is_waited_for_on_the_clock(build, frame):
    detector, eye = build()
    answer, latency = detector.detect(frame)
    assert (answer, detector.threshold) == (ANSWER, 0.6)
    assert latency >= 0
    detector.detect(frame)
    assert eye.stamps == pytest.approx([0.0, 1.3], abs=0.01)


def test_what_the_cell_does_not_handle_is_no_object_of_its(build, frame):
    answer, _ = build(classes=("cube",))[0].detect(frame)
    assert answer.confident == FOUND[:1]


def test_an_unavailable_detector_says_why_and_one_that_never_answers_is_given_up(build, frame):
    detector, eye = build(Unavailable("the server is gone"))
    for _ in range(2):
        with pytest.raises(Unavailable, match="the server is gone"):
            detector.detect(frame)
    assert eye.stamps == pytest.approx([0.0, 1.3], abs=0.01)
    with pytest.raises(Unavailable, match="no answer within 60 s of simulated time"):
        build(None)[0].detect(frame)


def test_frames_of_a_camera_are_searched_as_in_a_run_and_other_images_as_a_whole(build, frame):
    camera = WHOLE_IMAGE_CAMERA.model_copy(update={"table_view": (0, 0, 256, 256)})
    detector, eye = build(camera=camera, view="table")
    detector.detect(frame)
    assert (eye.camera, eye.views) == (camera, ["table"])
    detector, eye = build()
    detector.detect(frame)
    assert eye.views == ["full"]
    for size in ((300, 100), (64, 900)):
        assert list_regions("full", eye.camera.table_view, size) == [(0, 0, *size)]
    detector.close()
    assert eye.closed
