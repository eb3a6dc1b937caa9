"""Effects on detectors: dead, hanging, slow, blind, or unsure of everything.

Every request made while an effect lasts is affected; requests made before are answered as ever.
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


def unchanged(answer: Answer) -> Answer:
    """Return an answer as it is."""
    return answer


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


@dataclass(frozen=True)
class DetectorDisturbed(Effect):
    """A detector that answers late, wrongly, or not at all.

    Attributes:
        name: Name of the effect in the record.
        change: Returns the answer instead of the true one; raises Unavailable for none.
        delay: Time by which the answer is late [s].
        until: Time on the clock before which nothing is answered while the effect lasts [s].
    """

    name: str
    change: Callable[[Answer], Answer] = unchanged
    delay: float = 0.0
    until: float = 0.0

    def request(self, ask: Callable[[], Request], now: Occasion) -> Request:
        """Ask the detector, and disturb its answer."""
        now.tell()
        return DisturbedRequest(ask(), self, now)


@dataclass
class DisturbedRequest:
    """A request to a disturbed detector; implements `Request`."""

    asked: Request
    effect: DetectorDisturbed
    now: Occasion
    _due: float = math.inf

    @property
    def ready(self) -> bool:
        """True once the answer is due, its delay is over, and the detector does not hang any longer."""
        time = self.now.scene.now
        if math.isinf(self._due) and self.asked.ready:
            self._due = time + self.effect.delay
        does_hang = not self.now.over and time < self.effect.until - TIME_TOLERANCE
        return time >= self._due - TIME_TOLERANCE and not does_hang

    def result(self) -> Answer:
        """Return the disturbed answer, or raise Unavailable."""
        return self.effect.change(self.asked.result())


def detector_dead() -> Effect:
    """Requests are not answered: `Detect` is `unavailable`."""
    return DetectorDisturbed("detector_dead", refuse)


def detector_hangs(until: float = math.inf) -> Effect:
    """Requests are answered only when this is over; while a node runs that waits for one, that is never.

    Args:
        until: Time on the run's clock at which they are answered in any case [s].
    """
    return DetectorDisturbed("detector_hangs", until=until)


def detector_given_up(deadline: float) -> Effect:
    """Requests are not answered, and given up at their deadline: `Detect` is `unavailable`.

    Args:
        deadline: Time by which that is later than an answer would be [s].
    """
    return DetectorDisturbed("detector_hangs", refuse, delay=deadline)


def detector_slow(by: float) -> Effect:
    """Requests are answered later than they would be.

    Args:
        by: The delay [s].

    Raises:
        InputError: The answer would come sooner.
    """
    if by < 0:
        raise InputError(f"a slow detector answers later, not by {by:g} s")
    return DetectorDisturbed("detector_slow", delay=by)


def detector_unsure() -> Effect:
    """Everything is seen with less confidence than counts: `Detect` is `unsure`."""
    return DetectorDisturbed("detector_unsure", doubt)


def detector_blind() -> Effect:
    """Nothing is seen: `Detect` succeeds with an empty list."""
    return DetectorDisturbed("detector_blind", overlook)
