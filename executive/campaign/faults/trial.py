"""One run in which something goes wrong on purpose, watched and judged."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from executive.campaign.faults import judgement
from executive.campaign.faults.breakages import WANTED, broken_skills
from executive.campaign.faults.fault import Breakage, Fault, InjectedError
from executive.campaign.faults.listing import skill_nodes
from executive.campaign.faults.rehearsal import Activations, Rehearsal
from executive.campaign.halt_checks import check_journal, check_rest, check_tool
from executive.campaign.subject import Subject
from executive.cell.cell_wrapper import CellWrapper
from executive.cell.workcell import Workcell
from executive.events import FaultInjected, InputRead, NodeEnded, RunEnded, TimedEvent
from executive.plugins import cell_kind
from executive.record.recorded_run import Recording, new_directory
from executive.record.recorder import Recorder
from executive.run.assembly import RunOptions, assemble
from executive.testing.bounded_cell import BoundedCell
from executive.testing.faults import DisturbedCell, disturbed
from executive.view.figures.fault_trials import Trial
from executive.view.report.page import leave_report

Numbered = Mapping[int, Fault]
"""Faults by their numbers in the list, in the order in which they are told."""


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
        directory = new_directory(trying.run, loaded, trying.options, runs)
        recording = Recording(trying.run, loaded, subject.skills, directory, Recorder(directory), ())
        result = recording.execute(subject.seed, began)
        leave_report(result)
        outcome = RunEnded(
            result["status"], result["reason"], result["message"], result["node"], result["empty"],
            result["holds"], result["ticks"], result["robot_time_s"],
        )  # fmt: skip
        return trying.judged(outcome), directory.path


def empty_trial(faults: Numbered) -> Trial:
    """Return the trial of a run of which nothing is known yet."""
    last = list(faults.values())[-1]
    told = tuple(map(str, faults.values()))
    return Trial(tuple(faults), told, last.name, last.place, last.what, last.when)


class _Trying:
    """A run and all that is seen of it."""

    def __init__(self, subject: Subject, rehearsal: Rehearsal, faults: Numbered) -> None:
        self._subject, self._rehearsal, self._faults = subject, rehearsal, faults
        self._events: list[TimedEvent] = []
        self._breakages = [breakage for fault in faults.values() for breakage in fault.breakages]
        self._activations = Activations()
        self._stopped = False
        happenings = [happening for fault in faults.values() for happening in fault.happenings]
        own = {node.path: subject.skills[node.skill] for node in skill_nodes(subject)}
        self.options = RunOptions(
            subject.seed,
            subject.requests,
            kind=disturbed(self._kind, happenings),
            substitutes=broken_skills(self._breakages, own),
        )
        self.run = assemble(subject.loaded, subject.skills, self.options, [self._see, self._activations])
        workcell = self.run.workcell
        assert isinstance(workcell, DisturbedCell)
        self.run.observe(workcell.hear)

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
            items={name: count for name, count in items.items() if name != "rows"},
            audit=audit,
            robot_time=outcome.robot_time,
            entered=frozenset(self._activations.counts),
            problems=tuple(problems),
            remark=judgement.remark(outcome, faults),
        )

    def _kind(self, *args: Any, **options: Any) -> Workcell:
        kind = self._subject.kind or cell_kind(self._subject.loaded.cell_config.kind)
        bounded = BoundedCell(kind(*args, **options), self._rehearsal.longest)
        return CellWrapper(bounded, after=self._stop_if_due)

    def _see(self, timed: TimedEvent) -> None:
        if not isinstance(timed.event, InputRead):
            self._events.append(timed)

    def _stop_if_due(self) -> None:
        """Wish a stop where a skill is to be halted."""
        if any(self._due(breakage) for breakage in self._breakages if breakage.how == "raises when halted"):
            self._stopped = True
            self.run.control.stop()

    def _due(self, breakage: Breakage) -> bool:
        began = self._activations.began.get(breakage.node)
        is_meant = self._activations.counts[breakage.node] in breakage.starts
        return began is not None and is_meant and self.run.tick >= began + breakage.after

    def _hidden(self) -> judgement.Hidden:
        workcell = self.run.workcell
        assert isinstance(workcell, DisturbedCell)
        return judgement.out_of_sight(workcell.hand.things, workcell.cell.bins.values(), self._events)

    def _happened(self, fault: Fault) -> bool:
        """Tell whether a fault found its occasion."""
        names = {happening.what.name for happening in fault.happenings}
        injected = (one.event for one in self._events if isinstance(one.event, FaultInjected))
        if any(event.name in names for event in injected):
            return True
        return bool(fault.breakages) and self._raised(fault)

    def _raised(self, fault: Fault) -> bool:
        """Tell whether a node failed as it was to; True for a fault that is about none."""
        if fault.ends_run:
            name = InjectedError.__name__
            return any(name in event.message for event in self._ends(fault, "INVALID"))
        if not fault.reason:
            return True
        failures = [event for event in self._ends(fault, "FAILURE") if event.reason == fault.what]
        return any(not fault.breakages or event.message == WANTED for event in failures)

    def _ends(self, fault: Fault, status: str) -> Iterator[NodeEnded]:
        for one in self._events:
            event = one.event
            if isinstance(event, NodeEnded) and (event.node, event.status) == (fault.about, status):
                yield event
