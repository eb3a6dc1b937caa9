"""Let time pass."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from executive.cell import Cell, LeastTimes, Steps
from executive.skill import Seconds, Skill, param


class Wait(Skill):
    """Do nothing until `seconds` have passed on the run's clock."""

    seconds: Seconds = param(ge=0, le=3600, doc="how long")
    reasons: ClassVar = ()

    @classmethod
    def shortest(cls, least: LeastTimes, given: Mapping[str, Any]) -> float:
        """Return `seconds`."""
        del least
        return float(given.get("seconds", 0.0))

    def run(self, cell: Cell) -> Steps:
        """Sleep on the clock."""
        yield from cell.clock.sleep(self.seconds)
