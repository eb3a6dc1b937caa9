"""A circuit breaker: who fails again and again is left alone for a while."""

from __future__ import annotations


class Breaker:
    """Says whether something that may be broken is worth asking; on the run's clock.

    It opens with `failures` failures in a row. Then nobody asks for `rest`, and after that once per
    `rest`, until it succeeds. A trial that is given up unheard of therefore blocks nothing for ever.
    Pattern: Nygard, Release It!, "Circuit Breaker".

    Args:
        failures: After how many failures in a row it opens.
        rest: How long it is left alone then [s].
    """

    def __init__(self, failures: int, rest: float) -> None:
        self._most = failures
        self._rest = rest
        self._failures = 0
        self._shut_until = 0.0

    @property
    def failures(self) -> int:
        """How many failures there were since the last success."""
        return self._failures

    @property
    def next_trial(self) -> float:
        """Time from which it may be asked again [s]; means something only while it is open."""
        return self._shut_until

    @property
    def is_open(self) -> bool:
        """True from the last failure that was one too many until the next success."""
        return self._failures >= self._most

    def admits(self, now: float) -> bool:
        """Tell whether to ask at `now` [s]; whoever is told so does ask: while it is open, one per `rest`."""
        if not self.is_open:
            return True
        if now < self._shut_until:
            return False
        self._shut_until = now + self._rest
        return True

    def succeeded(self) -> None:
        """Record an answer."""
        self._failures = 0

    def failed(self, now: float) -> None:
        """Record at `now` [s] that there was none."""
        self._failures += 1
        self._shut_until = now + self._rest
