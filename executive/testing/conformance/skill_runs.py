"""Test runs of one skill and their injected faults; all conformance checks of the skill share the runs."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from executive.cells.fake.arm import FakeMotion
from executive.skill import Skill
from executive.testing import faults
from executive.testing.conformance.situations import Arrange, NotTestable, Situation, list_situations
from executive.testing.conformance.skill_test_run import NamedFault, SkillTestRun
from executive.testing.faults.effect import Effect, Occurrence

MAX_HALTS = 40
"""Maximum number of halts at evenly spaced ticks of a run, and maximum number of halts at calls."""
RUN_INTERVALS = 20
"""Number of equal intervals of a run; the seal breaks at each boundary, in a test run of its own."""
PRECEDING_MOTION_STEPS = 24
"""Duration of a motion that is still in progress when the skill starts [control steps]."""


class TickNotReturned(NotTestable):
    """A tick of the skill did not return; no further run is executed."""


class SkillRuns:
    """The test runs of one skill; a run is executed at its first use.

    Args:
        name: Name of the skill in messages.
        skill: Class of the skill.
        arrange: Function, given by the author of the skill, that prepares the `SkillScene` of each run.
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
    def unhalted_runs(self) -> list[SkillTestRun]:
        """Runs without a halt: for each situation, one run without a fault and one run per fault."""
        runs_without_fault = [test_run for test_run, _ in self.repeated_runs]
        return runs_without_fault + [
            self._run(test_run.situation, fault)
            for test_run in runs_without_fault
            # If the run without a fault does not end, a run with a fault would not end either.
            if test_run.status != "RUNNING"
            for fault in _list_faults(self.skill, test_run)
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
        test_runs = [*self.unhalted_runs, *self.halted_runs]
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
    call_ticks = sorted({call.tick + offset for call in test_run.cell_calls for offset in (0, 1)})
    return sorted(tick for tick in {*evenly_spaced, *call_ticks[:MAX_HALTS]} if 1 <= tick <= test_run.ticks)


def _list_faults(skill: type[Skill], run: SkillTestRun) -> Iterator[NamedFault]:
    """Yield the faults that can affect a skill, given a run of the skill without a fault."""
    for fault in _FAULTS:
        can_occur = run.holds_object_at_start or not fault.requires_holding
        if can_occur and (not fault.resource or fault.resource in skill.uses):
            yield fault
    if "tool" in skill.uses:
        for tick in sorted({round(run.ticks * index / RUN_INTERVALS) for index in range(RUN_INTERVALS + 1)}):
            yield NamedFault(f"while the seal breaks at tick {tick}", faults.seal_breaks(None), tick=tick)


def _move_arm(occurrence: Occurrence) -> bool:
    """Start a motion of the arm, as a preceding skill could have done."""
    arm = occurrence.context.cell.arm
    arm.start(FakeMotion(np.tile(arm.q, (PRECEDING_MOTION_STEPS, 1))))
    return True


def _empty_table(occurrence: Occurrence) -> bool:
    """Remove all objects from the table; return False (not finished), to remove later objects too."""
    context = occurrence.context
    while (true_object := context.find_object("nearest", "")) is not None:
        context.world.remove(true_object)
    return False


_FAULTS = (
    NamedFault("while the suction cup cannot seal", faults.seal_fails(), "tool"),
    NamedFault("while the tool sticks", faults.tool_does_not_release(), "tool", requires_holding=True),
    NamedFault("while the table is empty", Effect("table_empty", _empty_table)),
    NamedFault("while the table has changed since the last image", faults.table_bumped()),
    NamedFault("while the arm collides", faults.arm_collides(), "arm"),
    NamedFault("while the arm still moves at the start", Effect("arm_moves", _move_arm), "arm"),
    NamedFault("while the goal is unreachable", faults.no_path(), "arm"),
    NamedFault("while every path is blocked", faults.no_path(is_blocked=True), "arm"),
    NamedFault("while the arm occludes the table", faults.workspace_occluded()),
    NamedFault("while no depth is measured", faults.no_depth()),
    NamedFault("while no detector answers", faults.detector_dead()),
    NamedFault("while the detectors detect nothing", faults.detector_finds_nothing()),
    NamedFault("while all confidences are low", faults.detector_unsure()),
    NamedFault("while the operator quits", faults.operator_quits()),
    NamedFault("while the operator requests a new scan", faults.operator_asks_rescan()),
)
"""Faults that begin at the start of a run."""
