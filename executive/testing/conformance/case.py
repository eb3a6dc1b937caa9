"""All runs of one skill that its checks look at, each made once."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from executive.skill import Skill
from executive.testing.conformance.adversities import Adversity, adversities
from executive.testing.conformance.rehearsal import Rehearsal
from executive.testing.conformance.situations import Arrange, NotTried, Situation, situations

MAX_HALTS = 40
"""Number of halts spread over a run, and of those at its calls."""


class GotStuck(NotTried):
    """A tick of a skill did not come back, so that it was not tried any further; the text says where."""


class Case:
    """The runs that the checks of one skill share.

    Args:
        name: Name of the skill.
        skill: Its class.
        arrange: What its author wants to be otherwise on the stage.
    """

    def __init__(self, name: str, skill: type[Skill], arrange: Arrange) -> None:
        self.name, self.skill, self._arrange = name, skill, arrange
        self._stuck = ""

    @cached_property
    def situations(self) -> list[Situation]:
        """Every situation in which the skill is tried; raises NotArranged."""
        return list(situations(self.skill, self._arrange))

    @cached_property
    def twice(self) -> list[tuple[Situation, Rehearsal, Rehearsal]]:
        """Two runs to the end in every situation, nothing going wrong."""
        return [(one, self._run(one), self._run(one)) for one in self.situations]

    @cached_property
    def ended(self) -> list[Rehearsal]:
        """A run to the end in every situation, with nothing going wrong, and under every adversity."""
        plain = [first for _, first, _ in self.twice]
        return plain + [
            self._run(situation, adversity)
            for situation, first, _ in self.twice
            # A run that never ends where all is well would not end here, either.
            if first.status != "RUNNING"
            for adversity in adversities(self.skill, first.ticks, holding=first.held)
        ]

    @cached_property
    def halted(self) -> list[Rehearsal]:
        """A run for every moment of every situation at which the skill may be halted."""
        return [
            self._run(situation, halt_at=tick)
            for situation, first, _ in self.twice
            if first.status != "RUNNING"
            for tick in _halt_ticks(first)
        ]

    def _run(
        self, situation: Situation, adversity: Adversity | None = None, halt_at: int | None = None
    ) -> Rehearsal:
        """Run the skill once.

        Raises:
            GotStuck: It did not come back, or a run before it: to wait once is enough.
        """
        if self._stuck:
            raise GotStuck(self._stuck)
        rehearsal = Rehearsal(self.skill, situation, self._arrange, adversity, halt_at)
        if rehearsal.status == "STUCK":
            halted = ", halted there," if rehearsal.ticks == halt_at else ""
            self._stuck = (
                f"{rehearsal.where} at tick {rehearsal.ticks}{halted} {self.name} {rehearsal.message}. "
                "The arm waits for every tick: yield in each loop that waits, or leave work to a detector."
            )
            raise GotStuck(self._stuck)
        if adversity is not None or halt_at is not None:
            # The arguments of calls may be large: frames are among them.
            rehearsal.calls = [replace(call, arguments=()) for call in rehearsal.calls]
        return rehearsal


def _halt_ticks(first: Rehearsal) -> list[int]:
    """Return the ticks at which a run is halted: those of its calls, those after them, and some between."""
    spread = np.linspace(1, first.ticks, min(first.ticks, MAX_HALTS), dtype=int).tolist()
    around = sorted({call.tick + step for call in first.calls for step in (0, 1)})
    return sorted(tick for tick in {*spread, *around[:MAX_HALTS]} if 1 <= tick <= first.ticks)
