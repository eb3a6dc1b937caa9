"""An image with a cube and a duck whose truth is known, and detectors that say what they are told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from executive.cell.frame import Detection
from executive.errors import Unavailable
from executive.training.dataset import LabelledImage

CUBE, DUCK, HALF_HIDDEN = (10.0, 10.0, 40.0, 40.0), (100.0, 100.0, 140.0, 130.0), (200.0, 20.0, 230.0, 50.0)


class Scripted:
    """Gives one answer after the other, the last one for ever; one that is text is why it is unavailable."""

    name = "scripted"
    threshold = 0.5

    def __init__(self, *answers):
        self.answers = list(answers)
        self.frames = []

    def detect(self, frame):
        self.frames.append(frame)
        answer = self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]
        if isinstance(answer, str):
            raise Unavailable(answer)
        found = [Detection(label, confidence, box) for label, confidence, box in answer]
        return found, 10.0 * len(self.frames)


@pytest.fixture
def saying():
    """What makes a detector that gives these answers."""
    return Scripted


@pytest.fixture
def sample():
    """The image, a camera one metre above the table looking down: one pixel is 1/256 m."""
    truth = {
        "matrix": [[256.0, 0, 128], [0, 256.0, 128], [0, 0, 1]],
        "X_WC": [0, 0, 1, 1, 0, 0, 0],
        "part": [0, 0, 256, 256],
        "positions": [[-103 / 256, 103 / 256, 0.0], [-8 / 256, 13 / 256, 0.0]],
        "centres": [[-103 / 256, 103 / 256, 0.0], [-8 / 256, 13 / 256, 0.0]],
        "visible_fraction": [1.0, 1.0],
    }
    image = np.zeros((256, 256, 3), np.uint8)
    return LabelledImage("a.jpg", image, ("cube", "duck"), (CUBE, DUCK), (HALF_HIDDEN,), truth)


@pytest.fixture
def knowing(sample):
    """A function that returns the image with other truth beside what is known of it."""
    return lambda **known: replace(sample, truth={**sample.truth, **known})
