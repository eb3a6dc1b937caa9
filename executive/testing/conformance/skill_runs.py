"""Test runs of one skill, which its conformance checks share; a run is executed at its first use."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from executive.skill import Skill
from executive.testing.conformance.situations import Arrange, NotTestable, Situation, list_situations
from executive.testing.conformance.skill_faults import NamedFault, list_skill_faults
from executive.testing.conformance.skill_test_run import SkillTestRun

MAX_HALTS = 40
"""Maximum number of halts at evenly spaced ticks of a run, and maximum number of halts at calls."""


class TickNotReturned(NotTestable):
    """A tick of the skill did not return; no further run is executed."""


class SkillRuns:
    """The test runs of one skill.

    Args:
        name: Name of the skill in messages.
        skill: Class of the skill.
        arrange: Function of the author of the skill that prepares the `SkillScene` of each run.
    """

    def __init__(self, name: str, skill: type[Skill], arrange: Arrange) -> None:
        self.name, self.skill, self._arrange = name, skill, arrange
        self._stuck_message = ""

    @cached_property
    def situations(self) -> list[Situation]:
        """All situations in which the skill is tested; raises ArrangementFailed."""
        return list(list_situations(self.skill, self._arrange))

    @cached_property
    def repeated_runs(self) -> list[tuple[SkillTestRun, SkillTestRun]]:
        """For each situation, two equal runs without a fault and without a halt."""
        return [(self._run(situation), self._run(situation)) for situation in self.situations]

    @cached_property
    def complete_runs(self) -> list[SkillTestRun]:
        """Runs without a halt: for each situation, one run without a fault and one run per fault."""
        runs_without_fault = [test_run for test_run, _ in self.repeated_runs]
        return runs_without_fault + [
            self._run(test_run.situation, fault)
            for test_run in runs_without_fault
            # If the run without a fault does not end, a run with a fault would not end either.
            if test_run.status != "RUNNING"
            for fault in list_skill_faults(self.skill, test_run.ticks, is_holding=test_run.holds_before)
        ]

    @cached_property
    def halted_runs(self) -> list[SkillTestRun]:
        """Halted runs: for each situation, one run per tick of `_choose_halt_ticks`."""
        return [
            self._run(test_run.situation, halt_at=tick)
            for test_run, _ in self.repeated_runs
            if test_run.status != "RUNNING"
            for tick in _choose_halt_ticks(test_run)
        ]

    @property
    def ended_runs(self) -> list[SkillTestRun]:
        """All runs that ended with success, with a failure or with a halt."""
        test_runs = [*self.complete_runs, *self.halted_runs]
        return [test_run for test_run in test_runs if test_run.status in ("SUCCESS", "FAILURE", "HALTED")]

    def _run(
        self, situation: Situation, fault: NamedFault | None = None, halt_at: int | None = None
    ) -> SkillTestRun:
        """Run the skill once.

        Raises:
            TickNotReturned: A tick did not return, in this run or in an earlier one.
        """
        if self._stuck_message:
            raise TickNotReturned(self._stuck_message)
        test_run = SkillTestRun(self.skill, situation, self._arrange, fault, halt_at)
        if test_run.status == "STUCK":
            halt_text = ", when halted," if test_run.ticks == halt_at else ""
            self._stuck_message = (
                f"{test_run.description} at tick {test_run.ticks}{halt_text} {self.name} {test_run.message}. "
                "A long tick blocks the arm: yield in each loop that waits, "
                "and do long computations in a detector."
            )
            raise TickNotReturned(self._stuck_message)
        return test_run


def _choose_halt_ticks(test_run: SkillTestRun) -> list[int]:
    """Return the halt ticks of a run: evenly spaced, at each call, and one tick after each call."""
    evenly_spaced = np.linspace(1, test_run.ticks, min(test_run.ticks, MAX_HALTS), dtype=int).tolist()
    call_ticks = sorted({call.tick + offset for call in test_run.calls for offset in (0, 1)})
    return sorted(tick for tick in {*evenly_spaced, *call_ticks[:MAX_HALTS]} if 1 <= tick <= test_run.ticks)
