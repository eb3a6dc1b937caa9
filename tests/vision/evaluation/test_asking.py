"""Asking a detector of a cell file outside of any run."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.cell_config import DetectorConfig
from executive.errors import Unavailable
from executive.messages import Answer, Detection
from executive.vision.detectors.views import parts_of
from executive.vision.evaluation import asking
from executive.vision.evaluation.asking import TIMEOUT, WHOLE_IMAGE, CellDetector
from executive.vision.evaluation.truth import as_frame

CONFIGS = {"eye": DetectorConfig(kind="embedded", threshold=0.6)}
BOX = (1.0, 2.0, 3.0, 4.0)


class Delayed:
    """Answers after a time on the clock; one without an answer never does."""

    def __init__(self, clock, answer, delay=0.3):
        self.clock, self.answer, self.delay = clock, answer, delay
        self.stamps, self.views, self.closed = [], [], False

    def request(self, frame, view):
        self.stamps.append(frame.stamp)
        self.views.append(view)
        self.due = self.clock.now + self.delay
        return self

    @property
    def ready(self):
        return self.answer is not None and self.clock.now >= self.due

    def result(self):
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer

    def close(self):
        self.closed = True


@pytest.fixture
def built(monkeypatch):
    """Has detectors of a cell answer what `built.answer` is, and keeps what was built."""

    class Built:
        def __init__(self):
            found = Detection("cube", 0.9, BOX), Detection("boat", 0.8, BOX)
            self.answer = Answer("eye", found, CONFIGS["eye"].reliability)
            self.detectors, self.cameras = [], []

        def build(self, configs, *, camera, clock, base, seed):
            self.cameras.append(camera)
            self.detectors.append(Delayed(clock, self.answer))
            return {"eye": self.detectors[-1]}

    built = Built()
    monkeypatch.setattr(asking, "build_detectors", built.build)
    return built


@pytest.fixture
def frame(sample):
    return as_frame(sample, 1)


def test_an_answer_is_waited_for_on_the_clock(built, frame):
    detector = CellDetector(CONFIGS, "eye", base=Path())
    answer, latency = detector.ask(frame)
    assert (answer, detector.threshold) == (built.answer, 0.6)
    assert latency >= 0
    detector.ask(frame)
    first, second = built.detectors[0].stamps
    assert second - first == pytest.approx(1.3, abs=0.01)


def test_what_the_cell_does_not_handle_is_no_object_of_its(built, frame):
    answer, _ = CellDetector(CONFIGS, "eye", base=Path(), classes=("cube",)).ask(frame)
    assert [one.label for one in answer.found] == ["cube"]


def test_an_unavailable_detector_says_why(built, frame):
    built.answer = Unavailable("the server is gone")
    detector = CellDetector(CONFIGS, "eye", base=Path())
    for _ in range(2):
        with pytest.raises(Unavailable, match="the server is gone"):
            detector.ask(frame)
    first, second = built.detectors[0].stamps
    assert second - first == pytest.approx(1.3, abs=0.01)


def test_a_detector_that_never_answers_is_given_up(built, frame):
    built.answer = None
    with pytest.raises(Unavailable, match=f"no answer within {TIMEOUT:g} s of the clock"):
        CellDetector(CONFIGS, "eye", base=Path()).ask(frame)


def test_frames_of_a_camera_are_searched_as_in_a_run(built, frame):
    camera = WHOLE_IMAGE.model_copy(update={"table_view": (0, 0, 256, 256)})
    detector = CellDetector(CONFIGS, "eye", base=Path(), camera=camera, view="full")
    detector.ask(frame)
    assert built.cameras == [camera]
    assert built.detectors[0].views == ["full"]


def test_images_of_any_size_are_searched_as_a_whole(built, frame):
    detector = CellDetector(CONFIGS, "eye", base=Path())
    detector.ask(frame)
    assert built.detectors[0].views == ["full"]
    for size in ((300, 100), (64, 900)):
        assert parts_of("full", built.cameras[0].table_view, size) == [(0, 0, *size)]
    detector.close()
    assert built.detectors[0].closed
