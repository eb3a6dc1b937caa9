"""Faults of detectors: no answers, late answers, empty answers, or only low confidences.

A fault affects only the requests that a skill makes while the fault lasts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from executive.cell.detection import Answer
from executive.cell.protocols import Request
from executive.errors import InputError, Unavailable
from executive.testing.faults.effect import TIME_TOLERANCE, Effect, Occurrence

UNSURE_CONFIDENCE_FRACTION = 0.9
"""Maximum confidence of the detections of an unsure detector, as a fraction of its threshold."""

AnswerChange = Callable[[Answer], Answer]
"""Function that returns a changed answer of a detector, or raises Unavailable."""


def _raise_unavailable(answer: Answer) -> Answer:
    """Raise Unavailable instead of returning an answer."""
    raise Unavailable(f"detector {answer.detector}: the detector is dead (injected fault)")


def _reduce_confidence(answer: Answer) -> Answer:
    """Return an answer whose confidences are below the threshold."""
    max_confidence = UNSURE_CONFIDENCE_FRACTION * answer.error_rates.threshold
    detections = sorted((*answer.confident, *answer.doubtful), key=lambda detection: -detection.confidence)
    doubtful = tuple(replace(found, confidence=min(found.confidence, max_confidence)) for found in detections)
    return replace(answer, confident=(), doubtful=doubtful, unknown=())


def _remove_detections(answer: Answer) -> Answer:
    """Return an answer without detections."""
    return replace(answer, confident=(), doubtful=(), unknown=())


def make_detector_effect(
    name: str, change_answer: AnswerChange | None = None, delay: float = 0.0, hang_end: float = 0.0
) -> Effect:
    """Return an effect: the detector answers late, with changed answers, or not at all.

    Args:
        name: Name of the effect in the journal.
        change_answer: Function that changes an answer of the detector; None: no change.
        delay: Delay of each answer [s].
        hang_end: Time on the run's clock until which the detector hangs while the effect lasts [s].
    """
    arguments = (change_answer, delay, hang_end)
    return Effect(name, interceptors={"request": FaultyRequest.begin}, arguments=arguments)


def detector_dead() -> Effect:
    """Return an effect: requests fail without an additional delay, and `Detect` fails with `unavailable`."""
    return make_detector_effect("detector_dead", _raise_unavailable)


def detector_hangs(hang_end: float = math.inf) -> Effect:
    """Return an effect: requests are answered when the fault ends, but not later than at `hang_end`.

    `hang_end` is a time on the run's clock [s]. A node that ends before the fault gets no answer.
    """
    return make_detector_effect("detector_hangs", hang_end=hang_end)


def detector_times_out(delay: float) -> Effect:
    """Return an effect: requests fail `delay` [s] after the answer, and `Detect` fails with `unavailable`."""
    return make_detector_effect("detector_hangs", _raise_unavailable, delay=delay)


def detector_slow(delay: float) -> Effect:
    """Return an effect: requests are answered late, after a delay of `delay` [s].

    Raises:
        InputError: The delay is negative.
    """
    if delay < 0:
        raise InputError(f"the delay of a detector must be at least 0 s, not {delay:g} s")
    return make_detector_effect("detector_slow", delay=delay)


def detector_unsure() -> Effect:
    """Return an effect: all confidences are below the threshold, and `Detect` fails with `unsure`."""
    return make_detector_effect("detector_unsure", _reduce_confidence)


def detector_finds_nothing() -> Effect:
    """Return an effect: nothing is detected, and `Detect` succeeds with an empty list."""
    return make_detector_effect("detector_finds_nothing", _remove_detections)


@dataclass
class FaultyRequest:
    """A request to a faulty detector; implements `Request`.

    Attributes:
        request: The request without a fault.
        occurrence: Occurrence of the fault during which the request was made.
        change_answer: Function that changes the answer; None: no change.
        delay: Delay of the answer [s].
        hang_end: Time on the run's clock until which the request hangs during the occurrence [s].
        _answer_time: Time on the run's clock of the delayed answer [s]; infinite while it is unknown.
    """

    request: Request
    occurrence: Occurrence
    change_answer: AnswerChange | None
    delay: float
    hang_end: float
    _answer_time: float = math.inf

    @classmethod
    def begin(cls, proceed: Callable[[], Request], occurrence: Occurrence, *arguments: Any) -> FaultyRequest:
        """Make a request to the detector; `arguments` are those of the effect."""
        occurrence.emit_event()
        return cls(proceed(), occurrence, *arguments)

    @property
    def ready(self) -> bool:
        """True if the answer is available: the delay is over, and the detector does not hang."""
        now = self.occurrence.context.now
        if math.isinf(self._answer_time) and self.request.ready:
            self._answer_time = now + self.delay
        is_hanging = not self.occurrence.is_over and now < self.hang_end - TIME_TOLERANCE
        return now >= self._answer_time - TIME_TOLERANCE and not is_hanging

    def result(self) -> Answer:
        """Return the changed answer of the detector, or raise Unavailable."""
        answer = self.request.result()
        return answer if self.change_answer is None else self.change_answer(answer)
