"""Faults of detectors: dead, hanging, slow, blind, or unsure of everything.

A fault affects each request that is made while the fault lasts; earlier requests are answered as usual.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from executive.cell.detection import Answer
from executive.cell.protocols import Request
from executive.errors import InputError, Unavailable
from executive.testing.faults.effect import TIME_TOLERANCE, Effect, Occurrence

MAX_UNSURE_SHARE = 0.9
"""Highest confidence of an unsure detector, as a share of its threshold."""

AnswerChange = Callable[[Answer], Answer]
"""Returns a changed answer, or raises Unavailable."""


def _refuse(answer: Answer) -> Answer:
    """Raise Unavailable."""
    raise Unavailable(f"detector {answer.detector}: the detector is dead (injected fault)")


def _reduce_confidence(answer: Answer) -> Answer:
    """Return an answer whose confidences are below the threshold."""
    limit = MAX_UNSURE_SHARE * answer.error_rates.threshold
    detections = sorted((*answer.found, *answer.doubtful), key=lambda detection: -detection.confidence)
    doubtful = tuple(
        replace(detection, confidence=min(detection.confidence, limit)) for detection in detections
    )
    return replace(answer, found=(), doubtful=doubtful, unknown=())


def _remove_detections(answer: Answer) -> Answer:
    """Return an answer without detections."""
    return replace(answer, found=(), doubtful=(), unknown=())


def faulty_detector(
    name: str, change: AnswerChange | None = None, delay: float = 0.0, until: float = 0.0
) -> Effect:
    """The detector answers late, wrongly, or not at all.

    Args:
        name: Name of the effect in the record.
        change: Changes the true answer; None: no change.
        delay: Delay of the answer [s].
        until: Time on the run's clock before which no request is answered while the effect lasts [s].
    """
    return Effect(name, answers={"request": _request}, arguments=(change, delay, until))


def detector_dead() -> Effect:
    """Requests are not answered: `Detect` is `unavailable`."""
    return faulty_detector("detector_dead", _refuse)


def detector_hangs(until: float = math.inf) -> Effect:
    """Requests are answered only after the fault, which is never if the node of the fault waits for them.

    Args:
        until: Time on the run's clock at which requests are answered in any case [s].
    """
    return faulty_detector("detector_hangs", until=until)


def detector_given_up(deadline: float) -> Effect:
    """Requests expire at their deadline without an answer: `Detect` is `unavailable`.

    Args:
        deadline: Time between the usual answer and the deadline [s].
    """
    return faulty_detector("detector_hangs", _refuse, delay=deadline)


def detector_slow(by: float) -> Effect:
    """Requests are answered with a delay.

    Args:
        by: The delay [s].

    Raises:
        InputError: The delay is negative.
    """
    if by < 0:
        raise InputError(f"the delay of a detector must be at least 0 s, not {by:g} s")
    return faulty_detector("detector_slow", delay=by)


def detector_unsure() -> Effect:
    """All detections have a confidence below the threshold: `Detect` is `unsure`."""
    return faulty_detector("detector_unsure", _reduce_confidence)


def detector_blind() -> Effect:
    """Nothing is detected: `Detect` succeeds with an empty list."""
    return faulty_detector("detector_blind", _remove_detections)


@dataclass
class FaultyRequest:
    """A request to a faulty detector; implements `Request`."""

    request: Request
    occurrence: Occurrence
    change: AnswerChange | None
    delay: float
    until: float
    _due: float = math.inf

    @property
    def ready(self) -> bool:
        """True if the delay of the answer is over and the detector does not hang."""
        time = self.occurrence.scene.now
        if math.isinf(self._due) and self.request.ready:
            self._due = time + self.delay
        is_hanging = not self.occurrence.is_over and time < self.until - TIME_TOLERANCE
        return time >= self._due - TIME_TOLERANCE and not is_hanging

    def result(self) -> Answer:
        """Return the changed answer, or raise Unavailable."""
        answer = self.request.result()
        return answer if self.change is None else self.change(answer)


def _request(
    proceed: Callable[[], Request],
    occurrence: Occurrence,
    change: AnswerChange | None,
    delay: float,
    until: float,
) -> Request:
    occurrence.record()
    return FaultyRequest(proceed(), occurrence, change, delay, until)
