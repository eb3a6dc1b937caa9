"""How a mission goes when nothing goes wrong: what faults are aimed by."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass

from executive.campaign.faults.judgement import counts_text
from executive.campaign.subject import Subject
from executive.errors import InputError
from executive.events import NodeEnded, NodeStarted, TimedEvent
from executive.record.result import agrees
from executive.run.assembly import RunOptions, assemble


@dataclass(frozen=True)
class Rehearsal:
    """An undisturbed run.

    Attributes:
        robot_time: How long it took on its clock [s].
        placed: Objects that it brought into bins.
        activations: Control steps of every activation of each node that ran, by path.
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
        counts: Number of activations of every node that ran, by path.
        began: Tick at which every running node was started.
        lasted: Control steps of every activation that is over, by path.
    """

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.began: dict[str, int] = {}
        self.lasted: dict[str, list[int]] = defaultdict(list)

    def __call__(self, timed: TimedEvent) -> None:
        """Note an event."""
        match timed.event:
            case NodeStarted(node):
                self.counts[node] += 1
                self.began[node] = timed.tick
            case NodeEnded(node) if node in self.began:
                self.lasted[node].append(timed.tick - self.began.pop(node))


def rehearse(subject: Subject) -> Rehearsal:
    """Run a mission undisturbed and return how it went.

    Raises:
        InputError: It does not succeed, or its books are wrong.
        KeyboardInterrupt: The user ended it.
    """
    activations = Activations()
    options = RunOptions(subject.seed, subject.requests, kind=subject.kind)
    run = assemble(subject.loaded, subject.skills, options, [activations])
    with closing(run):
        outcome = run.execute()
        if outcome.status == "HALTED":
            raise KeyboardInterrupt
        items, audit = run.items(), run.audit()
    undisturbed = f"undisturbed, {subject.name} with seed {subject.seed}"
    if outcome.status != "SUCCESS":
        raise InputError(
            f"{undisturbed} ends as {outcome.status} {outcome.reason}: {outcome.message}; "
            "faults are judged by what they change in a run that succeeds: choose another seed"
        )
    if audit is not None and (audit["unseen"] or not agrees(items, audit, outcome.empty)):
        raise InputError(
            f"{undisturbed} leaves books that are not the world: the ledger says {counts_text(items)}; "
            f"the audit {counts_text(audit)}; choose another seed, or a mission that looks at the "
            "whole table"
        )
    found = {node: tuple(ticks) for node, ticks in activations.lasted.items()}
    return Rehearsal(outcome.robot_time, items["placed"], found)
