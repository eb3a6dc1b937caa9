"""Skills that conform: the base of those that break one rule each."""

from __future__ import annotations

from enum import Enum
from typing import ClassVar

from executive.arm import Goal
from executive.cell import Cell, Steps
from executive.messages import Target
from executive.moving import follow, heeding, planned
from executive.skill import EMPTY, In, Metres, Skill, param, port


class Push(Skill):
    """Push the target aside; the base of skills that do it wrongly."""

    target: In[Target] = port(doc="what to push")
    height: Metres = param(0.05, ge=0.0, le=0.2, doc="above the target's middle")
    reasons: ClassVar = ("unreachable", "blocked")
    uses: ClassVar = ("arm",)
    moves: ClassVar = True
    tool_state: ClassVar = (EMPTY, EMPTY)

    def run(self, cell: Cell) -> Steps:
        """Go there."""
        x, y, z = (float(value) for value in self.target.position)
        motion = yield from planned(self, cell.arm, lambda: (Goal((x, y, z + self.height)), heeding(cell)))
        yield from follow(self, cell, motion)


class Pause(Skill):
    """Wait for two control steps; the base of skills that do it wrongly."""

    reasons: ClassVar = ("tired",)

    def run(self, cell: Cell) -> Steps:
        """Wait."""
        yield
        yield


class Speed(Enum):
    """How fast."""

    SLOW = "slow"
