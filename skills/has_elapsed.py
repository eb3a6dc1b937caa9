"""Condition that a time has passed."""

from __future__ import annotations

from executive.cell.protocols import Cell
from executive.skill import Seconds, Skill, param


class HasElapsed(Skill):
    """Succeed if `seconds` have passed since the start of the run."""

    seconds: Seconds = param(ge=0.01, doc="time since the start of the run")
    is_condition = True
    reasons = ("too_early",)

    def run(self, cell: Cell) -> None:
        """Compare the clock of the run with the time."""
        # 1 ns covers the rounding errors of a clock that sums control periods.
        if (now := cell.clock.now) < self.seconds - 1e-9:
            raise self.failure("too_early", f"{now:.2f} of {self.seconds:g} s have passed")
