"""Asking a detector of a cell file outside of any run."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.cell.config import DetectorConfig
from executive.cell.frame import Detection
from executive.errors import Unavailable
from executive.training import evaluate
from executive.training.evaluate import WHOLE_IMAGE_CAMERA, EvaluatedDetector

CONFIGS = {"eye": DetectorConfig(kind="embedded", threshold=0.6)}
FOUND = [Detection(label, 0.9, (1.0, 2.0, 3.0, 4.0)) for label in ("cube", "boat")]


class Eye:
    """Finds what it is given, or raises it."""

    def __init__(self, result):
        self.result = result
        self.views = []
        self.closed = False

    def detect(self, frame, view):
        self.views.append(view)
        if isinstance(self.result, Exception):
            raise self.result
        return self.result

    def close(self):
        self.closed = True


@pytest.fixture
def build(monkeypatch):
    """Makes a detector of a cell that finds something, and returns it with what stands behind it."""

    def build(result=FOUND, **options):
        eye = Eye(result)

        def build_kinds(configs, *, camera, cell_folder, seed):
            eye.camera = camera
            return {"eye": eye}

        monkeypatch.setattr(evaluate, "build_kinds", build_kinds)
        return EvaluatedDetector(CONFIGS, "eye", base=Path(), **options), eye

    return build


def test_only_classes_of_the_cell_are_found_in_whole_images(build, sample):
    detector, eye = build(classes=("cube",))
    detections, latency = detector.detect(sample.to_frame(1))
    assert (detections, detector.threshold, latency >= 0) == (FOUND[:1], 0.6, True)
    assert (eye.views, eye.camera) == (["full"], WHOLE_IMAGE_CAMERA)
    detector.close()
    assert eye.closed


def test_an_unavailable_detector_says_why(build, sample):
    detector, _ = build(Unavailable("the server is gone"))
    with pytest.raises(Unavailable, match="server is gone"):
        detector.detect(sample.to_frame(1))
