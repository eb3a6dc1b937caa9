"""Skills whose calls do nothing, because what they return is dropped."""

from __future__ import annotations

from conforming_skills import Pause, Push

from executive import moving
from executive.cell import Cell, Steps
from executive.moving import follow, heeding, planned
from executive.skill import Skill, SkillFailed


def nodding(skill: Skill, cell: Cell) -> Steps:
    """Go nowhere: the motion is planned and never followed."""
    motion = yield from planned(skill, cell.arm, lambda: ("aside", heeding(cell)))
    moving.follow(skill, cell, motion)


class Idle(Push):
    """Push the target aside."""

    def run(self, cell: Cell) -> Steps:
        """Plan, and leave it at that."""
        motion = yield from planned(self, cell.arm, lambda: ("aside", heeding(cell)))
        follow(self, cell, motion)


class Nodding(Push):
    """Push the target aside."""

    def run(self, cell: Cell) -> Steps:
        """Leave it to a helper that does nothing."""
        yield from nodding(self, cell)


class Returning(Push):
    """Push the target aside."""

    def run(self, cell: Cell) -> Steps:
        """Return what nobody takes."""
        motion = yield from planned(self, cell.arm, lambda: ("aside", heeding(cell)))
        return follow(self, cell, motion)


class Keeping(Push):
    """Push the target aside."""

    def run(self, cell: Cell) -> Steps:
        """Keep the steps in a name that nobody reads."""
        motion = yield from planned(self, cell.arm, lambda: ("aside", heeding(cell)))
        steps = follow(self, cell, motion)  # noqa: F841


class Sleepless(Pause):
    """Wait."""

    def run(self, cell: Cell) -> Steps:
        """Wait for no time at all."""
        yield
        cell.clock.sleep(1.0)


class Impatient(Pause):
    """Wait."""

    def run(self, cell: Cell) -> Steps:
        """Wait in a way of one's own, or not."""
        yield
        self._rest(cell)

    def _rest(self, cell: Cell) -> Steps:
        return cell.clock.sleep(1.0)


class Timid(Pause):
    """Wait."""

    def run(self, cell: Cell) -> Steps:
        """Fail without saying so."""
        yield
        self.failed("tired", "after 1 step")


class Whispering(Pause):
    """Wait."""

    def run(self, cell: Cell) -> Steps:
        """Fail without saying so, in words of one's own."""
        yield
        self._give_up()

    def _give_up(self) -> SkillFailed:
        return self.failed("tired", "after 1 step")


class Still(Push):
    """Push the target aside."""

    def run(self, cell: Cell) -> Steps:
        """Plan, and think better of it."""
        yield from planned(self, cell.arm, lambda: ("aside", heeding(cell)))
