"""What can happen to a detector: dead, hanging, slow, or unsure of everything.

Every request made while it lasts is affected; what was asked before is answered as it would have been.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

from executive.cell import Request
from executive.errors import InputError, Unavailable
from executive.messages import Answer
from executive.testing.disturbances.effect import Effect, Occasion
from executive.testing.disturbances.scene import Scene

DOUBT = 0.9
"""Highest confidence of a detector that is unsure, as a share of its threshold."""
EARLY = 1e-9
"""Rounding allowed when two times on the clock are compared [s]."""


@dataclass(frozen=True)
class DetectorDead(Effect):
    """The detector gives no answer."""

    name: ClassVar = "detector_dead"

    def request(self, ask: Callable[[], Request], now: Occasion) -> Request:
        """Ask in vain."""
        now.tell()
        return Dead(ask())


@dataclass(frozen=True)
class DetectorHangs(Effect):
    """The detector answers only when it hangs no longer."""

    name: ClassVar = "detector_hangs"
    until: float

    def request(self, ask: Callable[[], Request], now: Occasion) -> Request:
        """Ask, and wait for the end."""
        now.tell()
        return Late(ask(), lambda: now.over or now.scene.now >= self.until - EARLY)


@dataclass(frozen=True)
class DetectorSlow(Effect):
    """The detector's answers take longer."""

    name: ClassVar = "detector_slow"
    by: float

    def request(self, ask: Callable[[], Request], now: Occasion) -> Request:
        """Ask, and wait longer than one would."""
        now.tell()
        return Slow(ask(), self.by, now.scene)


@dataclass(frozen=True)
class DetectorUnsure(Effect):
    """The detector is sure of nothing."""

    name: ClassVar = "detector_unsure"

    def request(self, ask: Callable[[], Request], now: Occasion) -> Request:
        """Ask, and believe nothing much."""
        now.tell()
        return Unsure(ask())


@dataclass(frozen=True)
class Dead:
    """A request that is not answered; implements `Request`, as the others here."""

    asked: Request

    @property
    def ready(self) -> bool:
        """True when an answer would be due."""
        return self.asked.ready

    def result(self) -> Answer:
        """Raise Unavailable."""
        raise Unavailable("the detector is dead, as the test wants it")


@dataclass(frozen=True)
class Late:
    """A request whose answer waits for something."""

    asked: Request
    come: Callable[[], bool]

    @property
    def ready(self) -> bool:
        """True once that has come, too."""
        return self.come() and self.asked.ready

    def result(self) -> Answer:
        """Return what the detector says."""
        return self.asked.result()


@dataclass
class Slow:
    """A request whose answer is due later than it would be."""

    asked: Request
    by: float
    scene: Scene
    _due: float = math.inf

    @property
    def ready(self) -> bool:
        """True once the time is over that it takes longer."""
        if math.isinf(self._due) and self.asked.ready:
            self._due = self.scene.now + self.by
        return self.scene.now >= self._due - EARLY

    def result(self) -> Answer:
        """Return what the detector says."""
        return self.asked.result()


@dataclass(frozen=True)
class Unsure:
    """A request whose answer has confidences under the threshold only."""

    asked: Request

    @property
    def ready(self) -> bool:
        """True when the answer is due."""
        return self.asked.ready

    def result(self) -> Answer:
        """Return what the detector says, and how little it believes it."""
        answer = self.asked.result()
        most = DOUBT * answer.reliability.threshold
        found = tuple(replace(one, confidence=min(one.confidence, most)) for one in answer.found)
        return replace(answer, found=found)


def detector_dead() -> Effect:
    """Requests are not answered: `Detect` is `unavailable`."""
    return DetectorDead()


def detector_hangs(until: float = math.inf) -> Effect:
    """Requests are answered only when this is over; while a node runs that waits for one, that is never.

    Args:
        until: Time on the run's clock at which they are answered in any case [s].
    """
    return DetectorHangs(until)


def detector_slow(by: float) -> Effect:
    """Requests are answered later than they would be.

    Args:
        by: How much later [s].

    Raises:
        InputError: The answer would come sooner.
    """
    if by < 0:
        raise InputError(f"a slow detector answers later, not by {by:g} s")
    return DetectorSlow(by)


def detector_unsure() -> Effect:
    """Everything is seen with less confidence than counts: `Detect` is `unsure`."""
    return DetectorUnsure()
