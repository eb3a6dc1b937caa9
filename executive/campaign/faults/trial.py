"""Trial of a fault campaign: one run with injected faults, and the checks of the run."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from executive.campaign.end_checks import check_arm_at_rest, check_held_item, check_journal
from executive.campaign.faults import trial_checks
from executive.campaign.faults.fault_list import list_skill_nodes
from executive.campaign.faults.nominal_run import ActivationRecorder, NominalRun
from executive.campaign.faults.planned_fault import (
    INJECTED_MESSAGE,
    InjectedError,
    PlannedFault,
    make_substitutes,
)
from executive.campaign.mission_under_test import MissionUnderTest
from executive.cell.cell_wrapper import CellWrapper
from executive.cell.workcell import Workcell
from executive.events import FaultInjected, InputRead, NodeEnded, RunEnded, TimedEvent
from executive.plugins import load_cell_kind
from executive.record.recorded_run import RecordedRun, make_run_directory
from executive.record.recorder import Recorder
from executive.run.assembly import RunOptions, assemble
from executive.testing.faults import FaultyCell, with_faults
from executive.view.report.page import try_write_report
from executive.view.results.fault_results import Trial

FaultsByNumber = Mapping[int, PlannedFault]
"""Faults of a run by number; the last fault is under test, and the faults before it let it occur."""


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
    start, loaded = time.perf_counter(), mission.loaded
    trial_run = _TrialRun(mission, nominal_run, faults)
    with closing(trial_run.run):
        directory = make_run_directory(trial_run.run, loaded, trial_run.options, runs)
        recording = RecordedRun(trial_run.run, loaded, mission.skills, directory, Recorder(directory), ())
        result = recording.execute(mission.seed, start)
        try_write_report(result.run)
        return trial_run.make_trial(trial_run.outcome), directory.path


def make_empty_trial(faults: FaultsByNumber) -> Trial:
    """Return a trial with these faults and without results."""
    last = list(faults.values())[-1]
    descriptions = tuple(map(str, faults.values()))
    return Trial(tuple(faults), descriptions, last.name, last.place, last.kind, last.occasion)


class _TrialRun:
    """A run with injected faults; records its events and checks its end."""

    def __init__(self, mission: MissionUnderTest, nominal_run: NominalRun, faults: FaultsByNumber) -> None:
        self._mission, self._nominal_run, self._faults = mission, nominal_run, faults
        self._events: list[TimedEvent] = []
        self._skill_faults = [skill_fault for fault in faults.values() for skill_fault in fault.skill_faults]
        self._recorder = ActivationRecorder()
        self._is_stopped = False
        cell_faults = [cell_fault for fault in faults.values() for cell_fault in fault.cell_faults]
        skills_by_path = {node.path: mission.skills[node.skill] for node in list_skill_nodes(mission)}
        self.options = RunOptions(
            mission.seed,
            mission.requests,
            kind=with_faults(self._make_cell, cell_faults, timeout=nominal_run.timeout),
            substitutes=make_substitutes(self._skill_faults, skills_by_path),
        )
        self.run = assemble(mission.loaded, mission.skills, self.options, [self._on_event, self._recorder])
        workcell = self.run.workcell
        assert isinstance(workcell, FaultyCell)
        self.run.add_observer(workcell.on_event)

    @property
    def outcome(self) -> RunEnded:
        """Recorded `RunEnded` event of the run."""
        return next(timed.event for timed in reversed(self._events) if isinstance(timed.event, RunEnded))

    def make_trial(self, outcome: RunEnded) -> Trial:
        """Check the ended run and return the trial."""
        run = self.run
        items, audit = run.count_items(), run.count_ground_truth()
        removed_count = trial_checks.count_injected_faults(self._events, "object_removed")
        is_bug_raised = any(self._has_effect(fault) for fault in self._faults.values() if fault.ends_run)
        faults, unobserved = tuple(self._faults.values()), self._count_unobserved_objects()
        problems = [
            *trial_checks.check_end(outcome, faults, self._mission.loaded.unhandled_failures, is_bug_raised),
            *trial_checks.check_tree(run.root),
            *check_journal(self._events, outcome),
            *trial_checks.check_ledger(outcome, items, audit, removed_count, unobserved),
            *trial_checks.check_success(outcome, audit, self._events),
            *trial_checks.check_losses(audit, self._events),
            *check_held_item(outcome, run.workcell),
            *check_arm_at_rest(run.workcell),
        ]
        return replace(
            make_empty_trial(self._faults),
            happened=all(map(self._has_occurred, faults)),
            raised=self._has_effect(faults[-1]),
            is_halted_by_user=outcome.status == "HALTED" and not self._is_stopped,
            status=outcome.status,
            reason=outcome.reason,
            message=outcome.message,
            node=outcome.node,
            missing=self._nominal_run.placed_count - items["placed"],
            items=items,
            audit=audit,
            robot_time=outcome.robot_time,
            entered_paths=frozenset(self._recorder.counts),
            problems=tuple(problems),
            remark=trial_checks.describe_unexpected_reason(outcome, faults),
        )

    def _make_cell(self, *args: Any, **options: Any) -> Workcell:
        make_inner_cell = self._mission.make_cell or load_cell_kind(self._mission.loaded.cell_config.kind)
        return CellWrapper(make_inner_cell(*args, **options), after_step=self._stop_run_if_due)

    def _on_event(self, timed: TimedEvent) -> None:
        if not isinstance(timed.event, InputRead):
            self._events.append(timed)

    def _stop_run_if_due(self) -> None:
        """Stop the run if the error of a halted skill is due."""
        for skill_fault in self._skill_faults:
            start = self._recorder.start_ticks.get(skill_fault.node)
            is_intended = self._recorder.counts[skill_fault.node] in skill_fault.start_numbers
            is_due = start is not None and self.run.tick >= start + skill_fault.delay_steps
            if skill_fault.kind == "raises when halted" and is_intended and is_due:
                self._is_stopped = True
                self.run.control.stop()

    def _count_unobserved_objects(self) -> trial_checks.UnobservedCounts:
        workcell, count = self.run.workcell, trial_checks.count_unobserved_objects
        assert isinstance(workcell, FaultyCell)
        return count(workcell.world.objects, workcell.cell.bins.values(), self._events)

    def _has_occurred(self, fault: PlannedFault) -> bool:
        """Return True if a fault was injected into the cell or into a skill."""
        names = {cell_fault.effect.name for cell_fault in fault.cell_faults}
        injected = {timed.event.name for timed in self._events if isinstance(timed.event, FaultInjected)}
        return not names.isdisjoint(injected) or (bool(fault.skill_faults) and self._has_effect(fault))

    def _has_effect(self, fault: PlannedFault) -> bool:
        """Return True if the node of a fault ended as the fault requires, or the fault requires no end."""
        ends = [timed.event for timed in self._events if isinstance(timed.event, NodeEnded)]
        node_ends = [end for end in ends if end.node == fault.location]
        if fault.ends_run:
            return any(end.status == "INVALID" and InjectedError.__name__ in end.message for end in node_ends)
        failures = [end for end in node_ends if (end.status, end.reason) == ("FAILURE", fault.kind)]
        messages = [end.message for end in failures]
        return not fault.is_failure_reason or any(
            not fault.skill_faults or message == INJECTED_MESSAGE for message in messages
        )
