"""Trial of a campaign: one run with injected faults, and its checks."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from executive.campaign.faults import judgement
from executive.campaign.faults.fault import (
    INJECTED_FAILURE,
    InjectedError,
    PlannedFault,
    make_substitutes,
)
from executive.campaign.faults.listing import skill_nodes
from executive.campaign.faults.rehearsal import Activations, Rehearsal
from executive.campaign.halt_checks import check_journal, check_rest, check_tool
from executive.campaign.subject import Subject
from executive.cell.cell_wrapper import CellWrapper
from executive.cell.workcell import Workcell
from executive.events import FaultInjected, InputRead, NodeEnded, RunEnded, TimedEvent
from executive.plugins import cell_kind
from executive.record.recorded_run import Recording, make_run_directory
from executive.record.recorder import Recorder
from executive.run.assembly import RunOptions, assemble
from executive.testing.faults import FaultyCell, with_faults
from executive.view.figures.fault import Trial
from executive.view.report.page import try_write_report

Numbered = Mapping[int, PlannedFault]
"""Faults by their numbers; the last fault is the tested one."""


def try_out(subject: Subject, rehearsal: Rehearsal, faults: Numbered) -> Trial:
    """Run a mission with these faults and return the trial."""
    trial_run = _TrialRun(subject, rehearsal, faults)
    with closing(trial_run.run):
        return trial_run.judge(trial_run.run.execute())


def record_trial(subject: Subject, rehearsal: Rehearsal, faults: Numbered, runs: Path) -> tuple[Trial, Path]:
    """Run a mission with these faults; return the trial and its run directory below `runs`.

    Raises:
        InputError: The run directory cannot be created.
        ExecutiveError: The result cannot be written.
    """
    start, loaded = time.perf_counter(), subject.loaded
    trial_run = _TrialRun(subject, rehearsal, faults)
    with closing(trial_run.run):
        directory = make_run_directory(trial_run.run, loaded, trial_run.options, runs)
        recording = Recording(trial_run.run, loaded, subject.skills, directory, Recorder(directory), ())
        result = recording.execute(subject.seed, start)
        try_write_report(result.run)
        return trial_run.judge(trial_run.outcome), directory.path


def empty_trial(faults: Numbered) -> Trial:
    """Return the trial of a run before its end."""
    last = list(faults.values())[-1]
    descriptions = tuple(map(str, faults.values()))
    return Trial(tuple(faults), descriptions, last.name, last.place, last.what, last.when)


class _TrialRun:
    """A run with faults, its events and its checks."""

    def __init__(self, subject: Subject, rehearsal: Rehearsal, faults: Numbered) -> None:
        self._subject, self._rehearsal, self._faults = subject, rehearsal, faults
        self._events: list[TimedEvent] = []
        self._skill_faults = [skill_fault for fault in faults.values() for skill_fault in fault.skill_faults]
        self._activations = Activations()
        self._stopped = False
        cell_faults = [cell_fault for fault in faults.values() for cell_fault in fault.cell_faults]
        own = {node.path: subject.skills[node.skill] for node in skill_nodes(subject)}
        self.options = RunOptions(
            subject.seed,
            subject.requests,
            kind=with_faults(self._kind, cell_faults, timeout=rehearsal.timeout),
            substitutes=make_substitutes(self._skill_faults, own),
        )
        self.run = assemble(subject.loaded, subject.skills, self.options, [self._note, self._activations])
        workcell = self.run.workcell
        assert isinstance(workcell, FaultyCell)
        self.run.add_observer(workcell.on_event)

    @property
    def outcome(self) -> RunEnded:
        """Recorded end of the run."""
        return next(timed.event for timed in reversed(self._events) if isinstance(timed.event, RunEnded))

    def judge(self, outcome: RunEnded) -> Trial:
        """Check the run after its end and return the trial."""
        run = self.run
        items, audit = run.count_items(), run.count_ground_truth()
        taken = judgement.count_faults(self._events, "object_removed")
        raised = any(self._has_raised(fault) for fault in self._faults.values() if fault.ends_run)
        faults = tuple(self._faults.values())
        problems = [
            *judgement.check_end(outcome, faults, self._subject.loaded.endings, raised),
            *judgement.check_tree(run.root),
            *check_journal(self._events, outcome),
            *judgement.check_ledger(outcome, items, audit, taken, self._count_hidden()),
            *judgement.check_success(outcome, audit, self._events),
            *judgement.check_losses(audit, self._events),
            *check_tool(outcome, run.workcell),
            *check_rest(run.workcell),
        ]
        return replace(
            empty_trial(self._faults),
            happened=all(map(self._has_happened, faults)),
            raised=self._has_raised(faults[-1]),
            is_halted_by_user=outcome.status == "HALTED" and not self._stopped,
            status=outcome.status,
            reason=outcome.reason,
            message=outcome.message,
            node=outcome.node,
            missing=self._rehearsal.placed - items["placed"],
            items=items,
            audit=audit,
            robot_time=outcome.robot_time,
            entered_paths=frozenset(self._activations.counts),
            problems=tuple(problems),
            remark=judgement.describe_other_reason(outcome, faults),
        )

    def _kind(self, *args: Any, **options: Any) -> Workcell:
        kind = self._subject.kind or cell_kind(self._subject.loaded.cell_config.kind)
        return CellWrapper(kind(*args, **options), after_step=self._stop_if_due)

    def _note(self, timed: TimedEvent) -> None:
        if not isinstance(timed.event, InputRead):
            self._events.append(timed)

    def _stop_if_due(self) -> None:
        """Stop the run if a skill must be halted now."""
        for skill_fault in self._skill_faults:
            start = self._activations.starts.get(skill_fault.node)
            is_intended = self._activations.counts[skill_fault.node] in skill_fault.starts
            is_due = start is not None and self.run.tick >= start + skill_fault.after
            if skill_fault.kind == "raises when halted" and is_intended and is_due:
                self._stopped = True
                self.run.control.stop()

    def _count_hidden(self) -> judgement.HiddenCounts:
        workcell = self.run.workcell
        assert isinstance(workcell, FaultyCell)
        return judgement.count_hidden(workcell.world.objects, workcell.cell.bins.values(), self._events)

    def _has_happened(self, fault: PlannedFault) -> bool:
        """Return True if a fault was injected."""
        names = {cell_fault.effect.name for cell_fault in fault.cell_faults}
        injected = {timed.event.name for timed in self._events if isinstance(timed.event, FaultInjected)}
        return not names.isdisjoint(injected) or (bool(fault.skill_faults) and self._has_raised(fault))

    def _has_raised(self, fault: PlannedFault) -> bool:
        """Return True if the node of a fault ended as intended; True for a fault without a node."""
        ends = [timed.event for timed in self._events if isinstance(timed.event, NodeEnded)]
        node_ends = [end for end in ends if end.node == fault.affected]
        if fault.ends_run:
            return any(end.status == "INVALID" and InjectedError.__name__ in end.message for end in node_ends)
        failures = [end for end in node_ends if (end.status, end.reason) == ("FAILURE", fault.what)]
        messages = [end.message for end in failures]
        return not fault.is_reason or any(
            not fault.skill_faults or message == INJECTED_FAILURE for message in messages
        )
