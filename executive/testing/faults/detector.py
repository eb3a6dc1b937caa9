"""Faults of detectors: dead, hanging, slow, blind, or unsure of everything.

A fault affects every request that is made while it lasts; earlier requests are answered as usual.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from executive.cell.detection import Answer
from executive.cell.protocols import Request
from executive.errors import InputError, Unavailable
from executive.testing.faults.effect import Effect, Occasion

DOUBT = 0.9
"""Highest confidence of a detector that is unsure, as a share of its threshold."""
TIME_TOLERANCE = 1e-9
"""Rounding allowed when two times on the clock are compared [s]."""


Change = Callable[[Answer], Answer]
"""Returns an answer instead of the true one; raises Unavailable for none."""


def refuse(answer: Answer) -> Answer:
    """Raise Unavailable."""
    raise Unavailable(f"detector {answer.detector}: the detector is dead, as the test wants it")


def doubt(answer: Answer) -> Answer:
    """Return an answer whose confidences are below the threshold."""
    most = DOUBT * answer.error_rates.threshold
    seen = sorted((*answer.found, *answer.doubtful), key=lambda one: -one.confidence)
    doubtful = tuple(replace(one, confidence=min(one.confidence, most)) for one in seen)
    return replace(answer, found=(), doubtful=doubtful, unknown=())


def overlook(answer: Answer) -> Answer:
    """Return an answer in which nothing was found."""
    return replace(answer, found=(), doubtful=(), unknown=())


def faulty_detector(
    name: str, change: Change | None = None, delay: float = 0.0, until: float = 0.0
) -> Effect:
    """The detector answers late, wrongly, or not at all.

    Args:
        name: Name of the effect in the record.
        change: Returns the answer instead of the true one; None: the true one.
        delay: Time by which the answer is late [s].
        until: Time on the clock before which nothing is answered while the effect lasts [s].
    """
    return Effect(name, answers={"request": _request}, arguments=(change, delay, until))


def detector_dead() -> Effect:
    """Requests are not answered: `Detect` is `unavailable`."""
    return faulty_detector("detector_dead", refuse)


def detector_hangs(until: float = math.inf) -> Effect:
    """Requests are answered only when this is over; while a node runs that waits for one, that is never.

    Args:
        until: Time on the run's clock at which they are answered in any case [s].
    """
    return faulty_detector("detector_hangs", until=until)


def detector_given_up(deadline: float) -> Effect:
    """Requests are not answered, and given up at their deadline: `Detect` is `unavailable`.

    Args:
        deadline: Time by which that is later than an answer would be [s].
    """
    return faulty_detector("detector_hangs", refuse, delay=deadline)


def detector_slow(by: float) -> Effect:
    """Requests are answered later than they would be.

    Args:
        by: The delay [s].

    Raises:
        InputError: The answer would come sooner.
    """
    if by < 0:
        raise InputError(f"a slow detector answers later, not by {by:g} s")
    return faulty_detector("detector_slow", delay=by)


def detector_unsure() -> Effect:
    """Everything is seen with less confidence than counts: `Detect` is `unsure`."""
    return faulty_detector("detector_unsure", doubt)


def detector_blind() -> Effect:
    """Nothing is seen: `Detect` succeeds with an empty list."""
    return faulty_detector("detector_blind", overlook)


@dataclass
class FaultyRequest:
    """A request to a faulty detector; implements `Request`."""

    asked: Request
    now: Occasion
    change: Change | None
    delay: float
    until: float
    _due: float = math.inf

    @property
    def ready(self) -> bool:
        """True once the answer is due, its delay is over, and the detector does not hang any longer."""
        time = self.now.scene.now
        if math.isinf(self._due) and self.asked.ready:
            self._due = time + self.delay
        does_hang = not self.now.over and time < self.until - TIME_TOLERANCE
        return time >= self._due - TIME_TOLERANCE and not does_hang

    def result(self) -> Answer:
        """Return the changed answer, or raise Unavailable."""
        answer = self.asked.result()
        return answer if self.change is None else self.change(answer)


def _request(
    proceed: Callable[[], Request], now: Occasion, change: Change | None, delay: float, until: float
) -> Request:
    now.record()
    return FaultyRequest(proceed(), now, change, delay, until)
