"""What can happen to the arm: something in its way, or no way at all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from executive.arm import Motion, Planning
from executive.errors import Unreachable
from executive.testing.disturbances.effect import Effect, Occasion
from executive.testing.disturbances.share import checked_share


@dataclass(frozen=True)
class ArmRunsInto(Effect):
    """The arm runs into something once it has gone so far."""

    name: ClassVar = "arm_runs_into"
    what: str
    share: float

    def act(self, now: Occasion) -> bool:
        """Stand in the way, if the arm is on its way."""
        if now.scene.progress < self.share:
            return False
        now.tell()
        now.scene.hand.stand_in_the_way(f"the arm ran into {self.what}")
        return True


@dataclass(frozen=True)
class NoWay(Effect):
    """The planner finds no motion."""

    name: ClassVar = "no_way"

    def plan(self, ask: Callable[[], Planning], now: Occasion) -> Planning:
        """Take its time, and find none."""
        now.tell()
        return Vain(ask())


@dataclass(frozen=True)
class Vain:
    """A motion being planned for which there is no way; implements `Planning`."""

    planning: Planning

    @property
    def ready(self) -> bool:
        """True once a motion would be known."""
        return self.planning.ready

    def result(self) -> Motion:
        """Raise Unreachable."""
        raise Unreachable("the planner finds no way, as the test wants it")


def arm_runs_into(what: str = "something", share: float = 0.5) -> Effect:
    """The arm runs into something on its way, once, and breaks its motion off: the skill is `blocked`.

    Args:
        what: What that is, for the text of the failure.
        share: How much of its motion the arm has behind it then, 0 to 1.

    Raises:
        InputError: There is no such share.
    """
    return ArmRunsInto(what, checked_share(share))


def no_way() -> Effect:
    """The planner finds no way while it lasts: the skill is `unreachable`."""
    return NoWay()
