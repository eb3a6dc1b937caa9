"""What the operator can do that no list of requests foresees."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from executive.testing.disturbances.effect import Effect, Occasion


class OperatorSays(Effect):
    """The operator wants something else first, and only then what they would have asked for."""

    answer: ClassVar[str | None]

    def ask(self, ask: Callable[[], str | None], now: Occasion) -> str | None:
        """Answer for the operator."""
        del ask
        now.tell()
        return self.answer


@dataclass(frozen=True)
class OperatorQuits(OperatorSays):
    """The operator wants nothing more."""

    name: ClassVar = "operator_quits"
    answer: ClassVar = None


@dataclass(frozen=True)
class OperatorAsksRescan(OperatorSays):
    """The operator wants a fresh look."""

    name: ClassVar = "operator_asks_rescan"
    answer: ClassVar = "rescan"


def operator_quits() -> Effect:
    """The operator wants nothing more while it lasts: `AwaitRequest` fails with `quit`."""
    return OperatorQuits()


def operator_asks_rescan() -> Effect:
    """The operator wants a fresh look while it lasts: `AwaitRequest` fails with `rescan`."""
    return OperatorAsksRescan()
