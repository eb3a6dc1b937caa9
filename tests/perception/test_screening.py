"""Answers of detectors, screened before a skill reads them."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from executive.cell.frame import Answer, Detection, ErrorRates, Frame
from executive.cell.objects import ObjectClass
from executive.errors import Crowded, Unavailable
from executive.geometry import Pose
from executive.perception.detectors.requests import MAX_BOXES, screen_answer, screen_detectors

RATES = ErrorRates(threshold=0.5, miss_rate=0.02, confusion_rate=0.0025, false_detections=0.02, jitter=0.7)
VISIBLE = np.ones((20, 20), bool)
VISIBLE[:, 10:] = False  # The arm hides the right half.
FRAME = Frame(1, "eye", np.zeros((20, 20, 3), np.uint8), None, np.eye(3), Pose.identity(), 0.0, VISIBLE, 0)

LOOKS = {"cube": "cube", "full_cube": "cube"}


def detect(
    label: str = "cube", confidence: float = 0.9, right: float = 9.0, second_confidence: float = 0.0
) -> Detection:
    return Detection(label, confidence, (right - 9.0, 0.0, right, 9.0), second_confidence)


def test_detections_are_divided_by_confidence_second_class_and_label() -> None:
    cube, weak, torn = detect(), detect(confidence=0.4), detect(confidence=0.7, second_confidence=0.4)
    mug, weak_mug = detect("mug"), detect("mug", confidence=0.4)
    answer = screen_answer(Answer("eye", (cube, mug, torn, weak, weak_mug), RATES), FRAME, "table", LOOKS)
    assert (answer.confident, answer.doubtful, answer.unknown) == ((cube,), (torn, weak), (mug,))


def test_a_box_that_the_arm_hides_is_left_out() -> None:
    shown, hidden = detect(right=12.0), detect(right=16.0)
    assert screen_answer(Answer("eye", (shown, hidden), RATES), FRAME, "table", LOOKS).confident == (shown,)


def test_a_class_that_looks_like_another_gets_the_label_of_the_other() -> None:
    answer = screen_answer(Answer("eye", (detect("full_cube"),), RATES), FRAME, "table", LOOKS)
    assert answer.confident == (detect("cube"),)


@pytest.mark.parametrize("box", [(0.4, 0.4, 0.6, 0.5), (30, 0, 39, 9), (0, 0, 9, math.nan), (9, 0, 0, 9)])
def test_a_box_that_cannot_show_an_object_in_the_image_is_an_error(box: Any) -> None:
    with pytest.raises(Unavailable, match="invalid box"):
        screen_answer(Answer("eye", (detect(), Detection("cube", 0.9, box)), RATES), FRAME, "table", LOOKS)


def raise_unavailable() -> Answer:
    raise Unavailable("the line is busy")


@pytest.mark.parametrize(
    ("result", "error", "message"),
    [
        (raise_unavailable, Unavailable, "detector eye: the line is busy"),
        (
            lambda: Answer("eye", (detect(confidence=1.5),), RATES),
            Unavailable,
            r"detector eye returned an invalid box: 'cube' 1.5 at \(0.0, 0.0, 9.0, 9.0\) .* 20 x 20",
        ),
        (
            lambda: Answer("eye", (detect(),) * (MAX_BOXES + 1), RATES),
            Crowded,
            "detector eye found 61 boxes in the view full, .* at most 60",
        ),
    ],
)
def test_an_unusable_answer_names_the_detector(result: Any, error: type[Exception], message: str) -> None:
    eye: Any = SimpleNamespace(request=lambda frame, view: SimpleNamespace(ready=True, result=result))
    request = screen_detectors({"eye": eye}, {"cube": ObjectClass("cube", 0.05, 0.0354)})["eye"].request(
        FRAME, "full"
    )
    with pytest.raises(error, match=message):
        request.result()
