"""One run in which something goes wrong on purpose, watched and judged."""

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
    broken_skills,
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
from executive.view.report.page import leave_report

Numbered = Mapping[int, PlannedFault]
"""Faults by their numbers in the list, in the order of their description."""


def try_out(subject: Subject, rehearsal: Rehearsal, faults: Numbered) -> Trial:
    """Run a mission with these faults and return what came of it."""
    trying = _Trying(subject, rehearsal, faults)
    with closing(trying.run):
        return trying.judged(trying.run.execute())


def record(subject: Subject, rehearsal: Rehearsal, faults: Numbered, runs: Path) -> tuple[Trial, Path]:
    """Do as `try_out`, and leave a run directory below `runs`; return it, too.

    Raises:
        InputError: It cannot be made.
        ExecutiveError: The result cannot be written.
    """
    began, loaded = time.perf_counter(), subject.loaded
    trying = _Trying(subject, rehearsal, faults)
    with closing(trying.run):
        directory = make_run_directory(trying.run, loaded, trying.options, runs)
        recording = Recording(trying.run, loaded, subject.skills, directory, Recorder(directory), ())
        result = recording.execute(subject.seed, began)
        leave_report(result.run)
        return trying.judged(trying.outcome), directory.path


def empty_trial(faults: Numbered) -> Trial:
    """Return the trial of a run of which nothing is known yet."""
    last = list(faults.values())[-1]
    descriptions = tuple(map(str, faults.values()))
    return Trial(tuple(faults), descriptions, last.name, last.place, last.what, last.when)


class _Trying:
    """A run and all that is seen of it."""

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
            substitutes=broken_skills(self._skill_faults, own),
        )
        self.run = assemble(subject.loaded, subject.skills, self.options, [self._see, self._activations])
        workcell = self.run.workcell
        assert isinstance(workcell, FaultyCell)
        self.run.observe(workcell.hear)

    @property
    def outcome(self) -> RunEnded:
        """Recorded end of the run."""
        return next(one.event for one in reversed(self._events) if isinstance(one.event, RunEnded))

    def judged(self, outcome: RunEnded) -> Trial:
        """Return what came of the run, which is over."""
        run = self.run
        items, audit = run.items(), run.audit()
        taken = judgement.count_of(self._events, "object_removed")
        raised = any(self._raised(fault) for fault in self._faults.values() if fault.ends_run)
        faults = tuple(self._faults.values())
        problems = [
            *judgement.check_end(outcome, faults, self._subject.loaded.endings, raised),
            *judgement.check_tree(run.root),
            *check_journal(self._events, outcome),
            *judgement.check_books(outcome, items, audit, taken, self._hidden()),
            *judgement.check_success(outcome, audit, self._events),
            *judgement.check_losses(audit, self._events),
            *check_tool(outcome, run.workcell),
            *check_rest(run.workcell),
        ]
        return replace(
            empty_trial(self._faults),
            happened=all(map(self._happened, faults)),
            raised=self._raised(faults[-1]),
            cut=outcome.status == "HALTED" and not self._stopped,
            status=outcome.status,
            reason=outcome.reason,
            message=outcome.message,
            node=outcome.node,
            missing=self._rehearsal.placed - items["placed"],
            items=items,
            audit=audit,
            robot_time=outcome.robot_time,
            entered=frozenset(self._activations.counts),
            problems=tuple(problems),
            remark=judgement.remark(outcome, faults),
        )

    def _kind(self, *args: Any, **options: Any) -> Workcell:
        kind = self._subject.kind or cell_kind(self._subject.loaded.cell_config.kind)
        return CellWrapper(kind(*args, **options), after=self._stop_if_due)

    def _see(self, timed: TimedEvent) -> None:
        if not isinstance(timed.event, InputRead):
            self._events.append(timed)

    def _stop_if_due(self) -> None:
        """Stop the run when a skill is to be halted."""
        for skill_fault in self._skill_faults:
            began = self._activations.began.get(skill_fault.node)
            is_meant = self._activations.counts[skill_fault.node] in skill_fault.starts
            is_due = began is not None and self.run.tick >= began + skill_fault.after
            if skill_fault.how == "raises when halted" and is_meant and is_due:
                self._stopped = True
                self.run.control.stop()

    def _hidden(self) -> judgement.Hidden:
        workcell = self.run.workcell
        assert isinstance(workcell, FaultyCell)
        return judgement.out_of_sight(workcell.world.objects, workcell.cell.bins.values(), self._events)

    def _happened(self, fault: PlannedFault) -> bool:
        """Return True if a fault was injected."""
        names = {cell_fault.effect.name for cell_fault in fault.cell_faults}
        if any(isinstance(one.event, FaultInjected) and one.event.name in names for one in self._events):
            return True
        return bool(fault.skill_faults) and self._raised(fault)

    def _raised(self, fault: PlannedFault) -> bool:
        """Return True if the node of a fault ended as the fault wants it; True for a fault without a node."""
        ends = [one.event for one in self._events if isinstance(one.event, NodeEnded)]
        mine = [end for end in ends if end.node == fault.about]
        if fault.ends_run:
            return any(end.status == "INVALID" and InjectedError.__name__ in end.message for end in mine)
        failures = [end for end in mine if (end.status, end.reason) == ("FAILURE", fault.what)]
        messages = [end.message for end in failures]
        return not fault.reason or any(
            not fault.skill_faults or message == INJECTED_FAILURE for message in messages
        )
