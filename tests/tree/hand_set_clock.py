"""A clock that the test sets."""

from __future__ import annotations

from collections.abc import Iterator


class Clock:
    """Stands still until the test sets `now` [s]."""

    step = 0.125

    def __init__(self) -> None:
        self.now = 0.0

    def sleep(self, duration: float) -> Iterator[None]:
        end = self.now + duration
        while self.now < end - self.step / 2:
            yield
