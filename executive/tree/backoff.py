"""How long to wait before trying again."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite


@dataclass(frozen=True)
class Backoff:
    """Waits that grow from one failure to the next.

    Attributes:
        first: Wait after the first failure [s], above 0.
        factor: Every further wait is so many times the one before.
        most: No wait is longer than this [s].
    """

    first: float
    factor: float = 1.0
    most: float = inf

    def __str__(self) -> str:
        grows = f", times {self.factor:g} each" if self.factor != 1 else ""
        ends = f", at most {self.most:g} s" if isfinite(self.most) else ""
        return f"{self.first:g} s{grows}{ends}"

    def delay(self, attempt: int) -> float:
        """Return how long to wait after the failure of an attempt, counted from 1 [s]."""
        try:
            return min(self.first * self.factor ** (attempt - 1), self.most)
        except OverflowError:
            return self.most
