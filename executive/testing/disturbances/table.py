"""What can happen to the table: somebody bumps it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from executive.testing.disturbances.effect import Effect, Occasion


@dataclass(frozen=True)
class TableBumped(Effect):
    """Something bumped the table, and the ledger was told: nothing need be where it was."""

    name: ClassVar = "table_bumped"

    def act(self, now: Occasion) -> bool:
        """Put everything in doubt."""
        now.tell()
        now.scene.cell.ledger.bumped()
        return True


def table_bumped() -> Effect:
    """Something bumps the table, once, and the ledger hears of it: frames and targets are `stale`."""
    return TableBumped()
