"""Detections run beside the tick loop and show on the run's clock; answers are screened."""

from __future__ import annotations

import math
import threading
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from executive.cell.frame import Answer, Detection, ErrorRates, Frame
from executive.cell.objects import Bin
from executive.errors import Crowded, DeadlinePassed, Unavailable
from executive.geometry import Pose
from executive.perception.detectors.cell_detector import MAX_BOXES, CellDetector

RATES = ErrorRates(threshold=0.5, miss_rate=0.02, confusion_rate=0.0025, false_detections=0.02, jitter=0.7)
VISIBLE = np.ones((20, 20), bool)
VISIBLE[:, 10:] = False  # The arm hides the right half.
FRAME = Frame(1, "eye", np.zeros((20, 20, 3), np.uint8), None, np.eye(3), Pose.identity(), 0.0, VISIBLE, 0)
LOOKS = {"cube": "cube", "full_cube": "cube"}


def find(
    label: str = "cube", confidence: float = 0.9, right: float = 9.0, second_confidence: float = 0.0
) -> Detection:
    return Detection(label, confidence, (right - 9.0, 0.0, right, 9.0), second_confidence)


class Kind:
    """A kind of detector that returns detections or raises an error, after a search has been let go."""

    def __init__(self, result: Any) -> None:
        self.result = result
        self.is_instant = True
        self.is_let_go = threading.Event()
        self.was_closed_early = False

    def detect(self, frame: Frame, view: str) -> list[Detection]:
        if not self.is_instant:
            assert threading.current_thread() is not threading.main_thread()
            self.is_let_go.wait()
        if isinstance(self.result, Exception):
            raise self.result
        return self.result

    def close(self) -> None:
        self.was_closed_early = not self.is_let_go.is_set()
        self.is_let_go.set()


@pytest.fixture
def clock() -> SimpleNamespace:
    return SimpleNamespace(now=0.0, is_simulated=True)


def make_detector(kind: Kind, clock: SimpleNamespace) -> CellDetector:
    return CellDetector("eye", kind, 0.05, clock, lambda frame: RATES, LOOKS)  # type: ignore[arg-type]


def screen(*found: Detection, view: str = "table") -> Answer:
    """Return the answer of a detector that finds this."""
    clock = SimpleNamespace(now=0.0, is_simulated=True)
    request = make_detector(Kind(found), clock).request(FRAME, view)
    clock.now = 0.05
    return request.result()


def test_an_answer_that_is_in_early_shows_only_when_it_is_due(clock: SimpleNamespace) -> None:
    request = make_detector(Kind([find()]), clock).request(FRAME, "table")
    assert not request.ready
    with pytest.raises(RuntimeError, match=r"due at 0\.050 s, and the time is 0\.000 s"):
        request.result()
    clock.now = 0.05 - 1e-12
    assert request.ready
    assert request.result() == Answer("eye", (find(),), RATES)


@pytest.fixture
def slow(clock: SimpleNamespace) -> Any:
    """A detector whose search has not been let go, its kind and a request that is due."""
    kind = Kind([])
    kind.is_instant = False
    detector = make_detector(kind, clock)
    request = detector.request(FRAME, "table")
    clock.now = 0.05
    yield detector, kind, request
    detector.close()


def test_a_simulated_clock_waits_for_an_answer_that_is_late(slow: Any) -> None:
    _, kind, request = slow
    threading.Timer(0.08, kind.is_let_go.set).start()
    assert request.ready
    assert kind.is_let_go.is_set()


def test_a_wall_clock_waits_for_no_answer(slow: Any, clock: SimpleNamespace) -> None:
    _, kind, request = slow
    clock.is_simulated = False
    assert not request.ready
    kind.is_let_go.set()
    request.future.result()
    assert request.ready
    clock.now = 0.04
    assert not request.ready


def test_closing_ends_the_running_search_and_starts_no_other(slow: Any) -> None:
    detector, kind, request = slow
    second_request = detector.request(FRAME, "table")
    detector.close()
    assert kind.was_closed_early
    assert (request.future.done(), second_request.future.cancelled()) == (True, True)


def test_what_the_search_raises_comes_out_of_the_result_as_it_is(clock: SimpleNamespace) -> None:
    request = make_detector(Kind(ZeroDivisionError("a bug")), clock).request(FRAME, "table")
    clock.now = 0.05
    assert request.ready
    with pytest.raises(ZeroDivisionError):
        request.result()


def test_that_a_deadline_has_passed_shows_when_it_has_passed_on_the_runs_clock_too(
    clock: SimpleNamespace,
) -> None:
    late = DeadlinePassed("no answer within 1.0 s", timeout=1.0)
    request = make_detector(Kind(late), clock).request(FRAME, "table")
    clock.now = 0.9
    assert not request.ready
    clock.now = 1.0 - 1e-12
    assert request.ready
    with pytest.raises(DeadlinePassed, match=r"^detector eye: no answer within 1\.0 s"):
        request.result()


def test_detections_are_divided_by_confidence_second_class_and_label() -> None:
    cube = find()
    weak = find(confidence=0.4)
    torn = find(confidence=0.7, second_confidence=0.4)
    mug = find("mug")
    weak_mug = find("mug", confidence=0.4)
    answer = screen(cube, mug, torn, weak, weak_mug)
    assert (answer.confident, answer.doubtful, answer.unknown) == ((cube,), (torn, weak), (mug,))


def test_a_box_that_the_arm_hides_is_left_out() -> None:
    shown = find(right=12.0)
    hidden = find(right=16.0)
    assert screen(shown, hidden).confident == (shown,)


def test_a_class_that_looks_like_another_gets_the_label_of_the_other() -> None:
    assert screen(find("full_cube")).confident == (find("cube"),)


@pytest.mark.parametrize("box", [(0.4, 0.4, 0.6, 0.5), (30, 0, 39, 9), (0, 0, 9, math.nan), (9, 0, 0, 9)])
def test_a_box_that_cannot_show_an_object_in_the_image_is_an_error(box: Any) -> None:
    with pytest.raises(Unavailable, match="invalid box"):
        screen(find(), Detection("cube", 0.9, box))


@pytest.mark.parametrize(
    ("result", "error", "message"),
    [
        (Unavailable("the line is busy"), Unavailable, "^detector eye: the line is busy"),
        (Crowded("too many"), Crowded, "^detector eye: too many"),
        (
            [find(confidence=1.5)],
            Unavailable,
            r"detector eye returned an invalid box: 'cube' 1.5 at \(0.0, 0.0, 9.0, 9.0\) .* 20 x 20",
        ),
        ([find()] * (MAX_BOXES + 1), Crowded, "detector eye found 61 boxes in the view full, .* at most 60"),
    ],
)
def test_an_unusable_answer_names_the_detector(
    result: Any, error: type[Exception], message: str, clock: SimpleNamespace
) -> None:
    request = make_detector(Kind(result), clock).request(FRAME, "full")
    clock.now = 0.05
    with pytest.raises(error, match=message):
        request.result()


def test_boxes_in_bins_do_not_make_a_table_crowded(clock: SimpleNamespace) -> None:
    everywhere = Bin("bin", np.zeros(3), np.array([99.0, 99.0, 0.1]), np.zeros((1, 2)))
    detector = replace(make_detector(Kind([find()] * 200), clock), bins=[everywhere])
    clock.now = 0.05
    assert len(detector.request(FRAME, "full").future.result().confident) == 200
