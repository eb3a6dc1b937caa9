"""Detections under way: worked on by one thread, visible on the run's clock."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, TimeoutError

from executive.cell import Clock
from executive.messages import Detection

Search = Callable[[], Sequence[Detection]]

SLICE = 0.05
"""Longest time the caller is held at once while an answer is overdue [s]; Ctrl-C works in between."""
EARLY = 1e-9
"""Rounding allowed when two times on the clock are compared [s]."""


class Pending:
    """A detection under way; implements `executive.cell.Request`.

    Args:
        answer: What the worker will leave.
        due: Time on the run's clock from which the answer is visible [s].
        clock: The run's clock.
    """

    def __init__(self, answer: Future[Sequence[Detection]], due: float, clock: Clock) -> None:
        self._answer = answer
        self._due = due
        self._clock = clock

    @property
    def ready(self) -> bool:
        """True from the tick at which the answer is due.

        At that tick the caller waits for a worker that is not done yet, so that the tick at which an
        answer becomes visible does not depend on the computer's speed.
        """
        if self._clock.now < self._due - EARLY:
            return False
        while not self._answer.done():
            try:
                self._answer.exception(SLICE)
            except TimeoutError:
                continue
        return True

    def result(self) -> Sequence[Detection]:
        """Return everything found at or above the detector's floor, most confident first.

        Raises:
            Unavailable: The detector gave no usable answer.
        """
        if not self.ready:
            raise RuntimeError(
                f"the detection is due at {self._due:.3f} s and it is {self._clock.now:.3f} s; "
                "wait until `ready` is true"
            )
        return self._answer.result()


class Worker:
    """One thread that works through searches in order."""

    def __init__(self, name: str) -> None:
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix=f"detector-{name}")

    def submit(self, search: Search, due: float, clock: Clock) -> Pending:
        """Start `search` beside the tick loop; its answer is visible from `due` [s] on `clock`."""
        return Pending(self._pool.submit(search), due, clock)

    def close(self) -> None:
        """End the thread after the search under way; those not begun are dropped."""
        self._pool.shutdown(wait=True, cancel_futures=True)
