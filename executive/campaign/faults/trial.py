"""Trial of a fault campaign: one run with injected faults, and the checks of the run."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping
from contextlib import closing
from dataclasses import asdict
from pathlib import Path

from executive.campaign.faults import trial_checks
from executive.campaign.faults.fault_list import list_skill_nodes
from executive.campaign.faults.nominal_run import NominalRun
from executive.campaign.faults.planned_fault import PlannedFault, SkillFault, make_substitutes
from executive.campaign.faults.results import Trial
from executive.campaign.mission_under_test import MissionUnderTest
from executive.events import InputRead, RunEnded, TimedEvent
from executive.record.recorded_run import RecordedRun, make_run_directory
from executive.record.recorder import Recorder
from executive.record.timeline.timeline import Timeline
from executive.run.assembly import RunOptions, assemble
from executive.testing.faults import FaultyCell, ScheduledFault, with_faults
from executive.view.report.page import try_write_report

FaultsByNumber = Mapping[int, PlannedFault]
"""Faults of a run by number; the last fault is under test, and the earlier faults activate its node."""


def run_trial(mission: MissionUnderTest, nominal_run: NominalRun, faults: FaultsByNumber) -> Trial:
    """Execute a mission with these faults and return the trial."""
    trial_run = _TrialRun(mission, nominal_run, faults)
    with closing(trial_run.run):
        return trial_run.make_trial(trial_run.run.execute())


def record_trial(
    mission: MissionUnderTest, nominal_run: NominalRun, faults: FaultsByNumber, runs: Path
) -> tuple[Trial, Path]:
    """Execute and record a mission with these faults; return the trial and its directory in `runs`.

    Raises:
        InputError: The run directory cannot be created.
        ExecutiveError: The result cannot be written.
    """
    start_time = time.perf_counter()
    trial_run = _TrialRun(mission, nominal_run, faults)
    run, loaded = trial_run.run, mission.loaded
    with closing(run):
        directory = make_run_directory(run, loaded, trial_run.options, runs)
        recorded_run = RecordedRun(run, loaded, directory, Recorder(directory))
        result = recorded_run.execute(mission.seed, start_time)
        try_write_report(result.run)
        assert trial_run.timeline.ended is not None, "every run emits its end"
        return trial_run.make_trial(trial_run.timeline.ended), directory.path


class _TrialRun:
    """A run with injected faults, its events and their timeline, and the checks of its end."""

    def __init__(self, mission: MissionUnderTest, nominal_run: NominalRun, faults: FaultsByNumber) -> None:
        self._mission, self._nominal_run, self._faults = mission, nominal_run, faults
        self._events: list[TimedEvent] = []
        injected_faults = [fault.injected for fault in faults.values()]
        self._skill_faults = [fault for fault in injected_faults if isinstance(fault, SkillFault)]
        self.timeline = Timeline()
        self._is_stopped = False
        cell_faults = [fault for fault in injected_faults if isinstance(fault, ScheduledFault)]
        skills_by_path = {node.path: mission.loaded.skills[node.skill] for node in list_skill_nodes(mission)}
        make_cell = with_faults(mission.make_cell, cell_faults, timeout=nominal_run.timeout)
        skills = make_substitutes(self._skill_faults, skills_by_path)
        self.options = RunOptions(mission.seed, mission.requests, make_cell=make_cell, substitutes=skills)
        self.run = assemble(mission.loaded, self.options, [self._store_event, self.timeline])
        assert isinstance(self.run.workcell, FaultyCell)
        self._workcell = self.run.workcell
        self.run.add_observer(self._workcell.on_event)
        self.run.control.call_between_ticks(self._stop_run_for_halt_error)

    def make_trial(self, run_end: RunEnded) -> Trial:
        """Check the ended run and return the trial."""
        run = self.run
        items, audit = run.count_items(), run.count_ground_truth()
        removed_count = trial_checks.count_injected_faults(self.timeline, "object_removed")
        faults, objects = tuple(self._faults.values()), self._workcell.world.objects
        bins = self._workcell.cell.bins.values()
        unobserved = trial_checks.count_unobserved_objects(objects, bins, self._events)
        is_bug_raised = any(fault.is_bug and self._has_effect(fault) for fault in faults)
        problems = [
            *trial_checks.check_end(run_end, faults, self._mission.loaded.unhandled_failures, is_bug_raised),
            *trial_checks.check_tree(run.root),
            *trial_checks.check_journal(self._events, run_end),
            *trial_checks.check_ledger(run_end, items, audit, removed_count, unobserved),
            *trial_checks.check_detection(run_end, audit, self.timeline),
            *trial_checks.check_losses(audit, self.timeline),
            *trial_checks.check_held_item(run_end, self._workcell),
            *trial_checks.check_arm_at_rest(self._workcell),
        ]
        return Trial(
            **asdict(run_end),
            faults=self._faults,
            have_occurred=all(map(self._has_occurred, faults)),
            had_effect=self._has_effect(faults[-1]),
            is_halted_by_user=run_end.status == "HALTED" and not self._is_stopped,
            missing_count=self._nominal_run.placed_count - items["placed"],
            items=items,
            audit=audit,
            entered_paths=frozenset(self.timeline.activation_by_path),
            problems=tuple(problems),
            remark=trial_checks.describe_unexpected_reason(run_end, faults),
        )

    def _store_event(self, timed: TimedEvent) -> None:
        if not isinstance(timed.event, InputRead):
            self._events.append(timed)

    def _stop_run_for_halt_error(self) -> None:
        """Halt the run while a skill runs whose injected bug raises an error during a halt."""
        for skill_fault in self._skill_faults:
            activation = self.timeline.activation_by_path.get(skill_fault.node)
            if skill_fault.kind != "raises when halted" or activation is None:
                continue
            number = self.timeline.end_counts.get(skill_fault.node, Counter()).total() + 1
            is_affected = activation.status == "RUNNING" and number in skill_fault.activations
            if is_affected and self.run.tick > activation.start_tick + skill_fault.delay_steps:
                self._is_stopped = True
                self.run.control.stop()

    def _has_occurred(self, fault: PlannedFault) -> bool:
        """Return True if a fault was injected into the cell or into a skill."""
        if isinstance(fault.injected, SkillFault):
            return self._has_effect(fault)
        return trial_checks.count_injected_faults(self.timeline, fault.injected.effect.name) > 0

    def _has_effect(self, fault: PlannedFault) -> bool:
        """Return True if the node of the fault ended as planned, by this fault or by another fault."""
        if not (fault.is_bug or fault.is_failure_reason):
            return True
        activations = self.timeline.activations
        return any(each.node == fault.location and fault.is_cause_of(each) for each in activations)
