"""Rehearsal of a campaign: a run without a fault, from which the times of faults are derived."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass

from executive.campaign.faults.judgement import format_counts
from executive.campaign.subject import Subject
from executive.errors import InputError
from executive.events import NodeEnded, NodeStarted, TimedEvent
from executive.record.result import is_confirmed_by_audit
from executive.run.assembly import RunOptions, assemble


@dataclass(frozen=True)
class Rehearsal:
    """A run without a fault.

    Attributes:
        robot_time: Duration on the run's clock [s].
        placed: Number of objects placed in bins.
        activations: Number of control steps of each activation, by path of the node.
    """

    robot_time: float
    placed: int
    activations: Mapping[str, tuple[int, ...]]

    @property
    def timeout(self) -> float:
        """Time on the run's clock after which a run counts as endless [s]."""
        return 60.0 + 10 * self.robot_time


class Activations:
    """Observer of the activations of nodes.

    Attributes:
        counts: Number of activations, by path of the node.
        starts: Tick of the start of each running node, by path.
        durations: Number of control steps of each finished activation, by path.
    """

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.starts: dict[str, int] = {}
        self.durations: dict[str, list[int]] = defaultdict(list)

    def __call__(self, timed: TimedEvent) -> None:
        """Count the start or the end of a node."""
        match timed.event:
            case NodeStarted(node):
                self.counts[node] += 1
                self.starts[node] = timed.tick
            case NodeEnded(node) if node in self.starts:
                self.durations[node].append(timed.tick - self.starts.pop(node))


def rehearse(subject: Subject) -> Rehearsal:
    """Run a mission without a fault.

    Raises:
        InputError: The mission does not succeed, or ledger and audit disagree.
        KeyboardInterrupt: The user halted the run.
    """
    activations = Activations()
    options = RunOptions(subject.seed, subject.requests, kind=subject.kind)
    run = assemble(subject.loaded, subject.skills, options, [activations])
    with closing(run):
        outcome = run.execute()
        if outcome.status == "HALTED":
            raise KeyboardInterrupt
        items, audit = run.count_items(), run.count_ground_truth()
    description = f"without a fault, {subject.name} with seed {subject.seed}"
    if outcome.status != "SUCCESS":
        raise InputError(
            f"{description} ends as {outcome.status} {outcome.reason}: {outcome.message}; "
            "a campaign needs a run that succeeds: choose another seed"
        )
    if audit is not None and (audit["unseen"] or not is_confirmed_by_audit(items, audit, outcome.empty)):
        raise InputError(
            f"{description} ends with a wrong ledger: the ledger says {format_counts(items)}; "
            f"the audit {format_counts(audit)}; choose another seed, or a mission that looks at the "
            "whole table"
        )
    found = {node: tuple(ticks) for node, ticks in activations.durations.items()}
    return Rehearsal(outcome.robot_time, items["placed"], found)
