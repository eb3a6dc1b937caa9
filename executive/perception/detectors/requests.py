"""Detections under way: worked on by another thread, visible on the run's clock."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future, TimeoutError
from dataclasses import dataclass

from executive.cell.detection import Answer, Detection
from executive.cell.error_rates import ErrorRates
from executive.cell.protocols import Clock, Request
from executive.errors import DeadlinePassed, Unavailable

SLICE = 0.05
"""Longest time the caller is held at once while an answer is overdue [s]; a second Ctrl-C ends it."""
EARLY = 1e-9
"""Rounding allowed when two times on the clock are compared [s]."""


@dataclass(frozen=True, eq=False)
class ChangedRequest:
    """A request whose answer is changed before it is read; implements `executive.cell.protocols.Request`.

    Attributes:
        request: The request.
        change: Returns the answer that is read instead.
        detector: Name of the detector, with which the text of an error begins; "": the text is not changed.
    """

    request: Request
    change: Callable[[Answer], Answer]
    detector: str = ""

    @property
    def ready(self) -> bool:
        """True once the answer can be read."""
        return self.request.ready

    def result(self) -> Answer:
        """Return the changed answer.

        Raises:
            Unavailable: The detector gave no usable answer.
        """
        try:
            answer = self.request.result()
        except Unavailable as error:
            if not self.detector:
                raise
            raise Unavailable(f"detector {self.detector}: {error}") from error
        return self.change(answer)


@dataclass(eq=False)
class Pending:
    """A detection under way; implements `executive.cell.protocols.Request`.

    Attributes:
        work: What the worker will leave.
        due: Time on the run's clock from which the answer is visible [s].
        clock: The run's clock.
        detector: Name of the detector.
        error_rates: Error rates of that detector.
        given_up: Time on the run's clock at which it shows that a deadline has passed [s].
    """

    work: Future[list[Detection]]
    due: float
    clock: Clock
    detector: str
    error_rates: ErrorRates
    given_up: float = -math.inf

    @property
    def ready(self) -> bool:
        """True from the tick at which the answer is due.

        At that tick the caller waits for a worker that is not done yet, so that the tick at which an
        answer becomes visible does not depend on the computer's speed. That a deadline has passed shows
        when it has passed on the run's clock too.
        """
        if self.clock.now < self.due - EARLY:
            return False
        while not self.work.done():
            try:
                self.work.exception(SLICE)
            except TimeoutError:
                continue
        expired = isinstance(self.work.exception(), DeadlinePassed)
        return not expired or self.clock.now >= self.given_up - EARLY

    def result(self) -> Answer:
        """Return what the detector says.

        Raises:
            Unavailable: The detector gave no usable answer.
        """
        if not self.ready:
            raise RuntimeError(
                f"the detection is due at {self.due:.3f} s and it is {self.clock.now:.3f} s; "
                "wait until `ready` is true"
            )
        return Answer(self.detector, tuple(self.work.result()), self.error_rates)
