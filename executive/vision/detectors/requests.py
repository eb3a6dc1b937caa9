"""Detections under way: worked on by one thread, visible on the run's clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, TimeoutError

from executive.cell import Clock
from executive.errors import DeadlinePassed
from executive.messages import Answer, Detection, Reliability

Search = Callable[[], Sequence[Detection]]

SLICE = 0.05
"""Longest time the caller is held at once while an answer is overdue [s]; a second Ctrl-C ends it."""
EARLY = 1e-9
"""Rounding allowed when two times on the clock are compared [s]."""


class Pending:
    """A detection under way; implements `executive.cell.Request`.

    Args:
        work: What the worker will leave.
        due: Time on the run's clock from which the answer is visible [s].
        clock: The run's clock.
        detector: Name of the detector.
        reliability: How it errs.
        given_up: Time on the run's clock at which it shows that a deadline has passed [s].
    """

    def __init__(
        self,
        work: Future[Sequence[Detection]],
        due: float,
        clock: Clock,
        *,
        detector: str,
        reliability: Reliability,
        given_up: float = -math.inf,
    ) -> None:
        self._work = work
        self._due = due
        self._clock = clock
        self._detector = detector
        self._reliability = reliability
        self._given_up = given_up

    @property
    def ready(self) -> bool:
        """True from the tick at which the answer is due.

        At that tick the caller waits for a worker that is not done yet, so that the tick at which an
        answer becomes visible does not depend on the computer's speed. That a deadline has passed shows
        when it has passed on the run's clock too.
        """
        if self._clock.now < self._due - EARLY:
            return False
        while not self._work.done():
            try:
                self._work.exception(SLICE)
            except TimeoutError:
                continue
        expired = isinstance(self._work.exception(), DeadlinePassed)
        return not expired or self._clock.now >= self._given_up - EARLY

    def result(self) -> Answer:
        """Return what the detector says.

        Raises:
            Unavailable: The detector gave no usable answer.
        """
        if not self.ready:
            raise RuntimeError(
                f"the detection is due at {self._due:.3f} s and it is {self._clock.now:.3f} s; "
                "wait until `ready` is true"
            )
        return Answer(self._detector, tuple(self._work.result()), self._reliability)


class Worker:
    """One thread that works through searches in order."""

    def __init__(self, name: str) -> None:
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix=f"detector-{name}")

    def submit(self, search: Search) -> Future[Sequence[Detection]]:
        """Start `search` beside the tick loop and return where its result will be."""
        return self._pool.submit(search)

    def close(self) -> None:
        """End the thread after the search under way; those not begun are dropped."""
        self._pool.shutdown(wait=True, cancel_futures=True)
