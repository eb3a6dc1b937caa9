"""Runs of one skill that its conformance checks share; each run is executed only once."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from executive.skill import Skill
from executive.testing.conformance.faults import NamedFault, list_skill_faults
from executive.testing.conformance.rehearsal import SkillRehearsal
from executive.testing.conformance.situations import Arrange, NotTried, Situation, list_situations

MAX_HALTS = 40
"""Maximum number of evenly spaced halts of a run, and, counted separately, of halts around its calls."""


class TickNotReturned(NotTried):
    """A tick of a skill did not return; the skill is not run again."""


class SkillRuns:
    """The runs that the checks of one skill share.

    Args:
        name: Name of the skill.
        skill: Class of the skill.
        arrange: Prepares the `Stage` of each run; written by the author of the skill.
    """

    def __init__(self, name: str, skill: type[Skill], arrange: Arrange) -> None:
        self.name, self.skill, self._arrange = name, skill, arrange
        self._stuck = ""

    @cached_property
    def situations(self) -> list[Situation]:
        """All situations in which the skill is tried; raises NotArranged."""
        return list(list_situations(self.skill, self._arrange))

    @cached_property
    def repeated_runs(self) -> list[tuple[Situation, SkillRehearsal, SkillRehearsal]]:
        """Two runs to the end in each situation, without a fault."""
        return [(situation, self._run(situation), self._run(situation)) for situation in self.situations]

    @cached_property
    def complete_runs(self) -> list[SkillRehearsal]:
        """Runs to the end: in each situation one without a fault, and one under each fault."""
        plain = [first for _, first, _ in self.repeated_runs]
        return plain + [
            self._run(situation, fault)
            for situation, first, _ in self.repeated_runs
            # If the undisturbed run does not end, a run under a fault will not end either.
            if first.status != "RUNNING"
            for fault in list_skill_faults(self.skill, first.ticks, holding=first.held)
        ]

    @cached_property
    def halted_runs(self) -> list[SkillRehearsal]:
        """Halted runs: in each situation one for each tick that `_choose_halt_ticks` returns."""
        return [
            self._run(situation, halt_at=tick)
            for situation, first, _ in self.repeated_runs
            if first.status != "RUNNING"
            for tick in _choose_halt_ticks(first)
        ]

    def _run(
        self, situation: Situation, fault: NamedFault | None = None, halt_at: int | None = None
    ) -> SkillRehearsal:
        """Run the skill once.

        Raises:
            TickNotReturned: A tick did not return, in this run or in an earlier one.
        """
        if self._stuck:
            raise TickNotReturned(self._stuck)
        rehearsal = SkillRehearsal(self.skill, situation, self._arrange, fault, halt_at)
        if rehearsal.status == "STUCK":
            halted = ", halted there," if rehearsal.ticks == halt_at else ""
            self._stuck = (
                f"{rehearsal.where} at tick {rehearsal.ticks}{halted} {self.name} {rehearsal.message}. "
                "A tick blocks the arm: yield in each loop that waits, "
                "and leave long computations to a detector."
            )
            raise TickNotReturned(self._stuck)
        if fault is not None or halt_at is not None:
            # Arguments of calls may be large, such as frames.
            rehearsal.calls = [replace(call, arguments=()) for call in rehearsal.calls]
        return rehearsal


def _choose_halt_ticks(rehearsal: SkillRehearsal) -> list[int]:
    """Return the ticks at which to halt: evenly spaced ones, and those of and after calls."""
    evenly_spaced = np.linspace(1, rehearsal.ticks, min(rehearsal.ticks, MAX_HALTS), dtype=int).tolist()
    call_ticks = sorted({call.tick + offset for call in rehearsal.calls for offset in (0, 1)})
    return sorted(tick for tick in {*evenly_spaced, *call_ticks[:MAX_HALTS]} if 1 <= tick <= rehearsal.ticks)
