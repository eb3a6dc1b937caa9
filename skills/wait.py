"""Skill that waits for a fixed duration."""

from __future__ import annotations

from executive.cell.protocols import Cell, Steps
from executive.skill import Seconds, Skill, param


class Wait(Skill):
    """Wait until `seconds` have passed on the clock of the run."""

    seconds: Seconds = param(ge=0, le=3600, doc="duration")
    waits = "seconds"

    def run(self, cell: Cell) -> Steps:
        """Wait on the clock of the run."""
        return cell.clock.sleep(self.seconds)
