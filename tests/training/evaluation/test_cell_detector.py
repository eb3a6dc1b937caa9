"""Asking a detector of a cell file outside of any run."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.cell.config import DetectorConfig
from executive.cell.frame import Answer, Detection
from executive.errors import Unavailable
from executive.training import evaluate
from executive.training.evaluate import CellDetector

CONFIGS = {"eye": DetectorConfig(kind="embedded", threshold=0.6)}
FOUND = tuple(Detection(label, 0.9, (1.0, 2.0, 3.0, 4.0)) for label in ("cube", "boat"))
ANSWER = Answer("eye", FOUND, CONFIGS["eye"].error_rates)


class Delayed:
    """Gives its answer 0.3 s after it was asked; one without an answer never does."""

    def __init__(self, answer):
        self.answer = answer
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
        eye = Delayed(answer)

        def build_detectors(configs, *, camera, clock, base, seed):
            eye.camera = camera
            eye.clock = clock
            return {"eye": eye}

        monkeypatch.setattr(evaluate, "build_detectors", build_detectors)
        return CellDetector(CONFIGS, "eye", base=Path(), **options), eye

    return build


def test_an_answer_of_classes_of_the_cell_is_waited_for_on_the_clock(build, sample):
    detector, eye = build(classes=("cube",))
    answer, latency = detector.detect(sample.to_frame(1))
    assert (answer.confident, detector.threshold, latency >= 0) == (FOUND[:1], 0.6, True)
    detector.detect(sample.to_frame(1))
    assert eye.stamps == pytest.approx([0.0, 1.3], abs=0.01)


@pytest.mark.parametrize(
    ("answer", "text", "time"),
    [
        (Unavailable("the server is gone"), "server is gone", 1.3),
        (None, "no answer within 60 s of simul", 61),
    ],
)
def test_an_unavailable_detector_says_why_and_one_that_never_answers_is_given_up(
    build, sample, answer, text, time
):
    detector, eye = build(answer)
    for _ in range(2):
        with pytest.raises(Unavailable, match=text):
            detector.detect(sample.to_frame(1))
    assert eye.stamps == pytest.approx([0.0, time], abs=0.01)
