"""Skills that conform: the base of those that break one rule each."""

from __future__ import annotations

from enum import Enum
from typing import ClassVar

from executive.arm import Goal
from executive.cell import Cell, Steps
from executive.messages import Target
from executive.moving import follow, heeding, planned
from executive.skill import EMPTY, In, Metres, Skill, SkillFailed, param, port


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


class Careful(Pause):
    """Wait."""

    def run(self, cell: Cell) -> Steps:
        """Keep steps and a failure until they are wanted; `follow` is another one here."""
        steps, waiting, follow = cell.clock.sleep(0.01), self._rest(cell), list[int].append
        failure = self.failed("tired", "after 1 step")
        follow([], 1)
        yield from steps
        yield from waiting
        try:
            raise failure
        except SkillFailed:
            return

    def _rest(self, cell: Cell) -> Steps:
        return cell.clock.sleep(0.01)


class Speed(Enum):
    """How fast."""

    SLOW = "slow"
