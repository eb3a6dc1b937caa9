"""All faults of a mission, each in a run of its own."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial

from executive.campaign.faults.fault import PlannedFault
from executive.campaign.faults.listing import list_faults
from executive.campaign.faults.rehearsal import rehearse
from executive.campaign.faults.trial import Numbered, empty_trial, try_out
from executive.campaign.pool import do_all
from executive.campaign.subject import Subject
from executive.errors import InputError
from executive.mission.model.instance import inspection_instance, node_of
from executive.mission.model.nodes import InnerNode, Node, UseNode
from executive.mission.source import Mark
from executive.view.figures.fault import Branch, FaultFigures, Trial

DEEPEST = 4
"""Most faults in a run whose last one needs the others to happen at all."""

Numbers = tuple[int, ...]
"""Faults by their numbers in the list, the one that a run is about last."""


class Campaign:
    """A mission and everything that can go wrong in it.

    Args:
        subject: The mission.
        workers: How many runs go on at a time, each in a process of its own.
        progress: Told how many runs of how many are done.
        halting: Told that somebody wished to halt, as soon as they do.

    Attributes:
        subject: The mission.
        rehearsal: How it goes undisturbed.
        faults: Every single fault; its number is its place, from 1.

    Raises:
        ExecutiveError: The mission does not succeed undisturbed.
        KeyboardInterrupt: The user ended it before its first run.
    """

    def __init__(
        self,
        subject: Subject,
        *,
        workers: int = 2,
        progress: Callable[[int, int], None] | None = None,
        halting: Callable[[], None] | None = None,
    ) -> None:
        self.subject = subject
        self.rehearsal = rehearse(subject)
        self.faults: Sequence[PlannedFault] = list_faults(subject, self.rehearsal)
        self._workers, self._progress, self._halting = workers, progress, halting

    def fault(self, number: int) -> PlannedFault:
        """Return the fault with a number.

        Raises:
            InputError: There is none.
        """
        if not 1 <= number <= len(self.faults):
            raise InputError(
                f"{self.subject.name} has no fault {number}; they have the numbers 1 to {len(self.faults)}, "
                "and --list shows them"
            )
        return self.faults[number - 1]

    def singles(self) -> FaultFigures:
        """Try every single fault.

        What can happen only once something else has gone wrong is tried together with the first fault that
        leads there; where a node does not come to its reason by what happens to the cell, its skill says so.
        """
        trials: dict[Numbers, Trial] = {}
        complete = True
        while complete and (wanted := self._wanted(trials)):
            done, complete = self._tried(wanted, len(trials))
            trials |= {trial.numbers: trial for trial in done}
        ordered = sorted(trials.values(), key=lambda trial: (trial.numbers[-1], trial.numbers))
        return self._figures(ordered, complete, pairs=False)

    def pairs(self, count: int) -> FaultFigures:
        """Try so many pairs of faults that chance draws; the subject's seed decides which.

        What ends the run anyhow, and what happens only after something else, is in no pair.
        """
        numbers = [
            number
            for number, fault in enumerate(self.faults, 1)
            if not (fault.behind or fault.instead_of or fault.ends_run)
        ]
        most = len(numbers) * (len(numbers) - 1) // 2
        chance, drawn = random.Random(self.subject.seed), dict[Numbers, None]()
        while len(drawn) < min(count, most):
            first, second = sorted(chance.sample(numbers, 2))
            drawn[(first, second)] = None
        trials, complete = self._tried(list(drawn), 0)
        return self._figures(trials, complete, pairs=True)

    def these(self, numbers: Numbers) -> dict[int, PlannedFault]:
        """Return the faults with these numbers."""
        return {number: self.fault(number) for number in numbers}

    def _figures(self, trials: Iterable[Trial], complete: bool, *, pairs: bool) -> FaultFigures:
        subject, tried = self.subject, tuple(trials)
        return FaultFigures(
            subject.name, subject.cell, subject.seed, self.rehearsal.robot_time, len(self.faults), tried,
            branches(subject.loaded.tree, tried), complete, pairs,
        )  # fmt: skip

    def _wanted(self, trials: dict[Numbers, Trial]) -> list[Numbers]:
        """Return what can be tried now and was not."""
        ways = self._ways(trials.values())
        last = {numbers[-1]: trial for numbers, trial in trials.items()}
        wanted = []
        for number, fault in enumerate(self.faults, 1):
            if number in last:
                continue
            if fault.instead_of and (fault.instead_of not in last or last[fault.instead_of].raised):
                continue
            before = ways.get(fault.about) if fault.behind else ()
            if before is not None and len(before) < DEEPEST:
                wanted.append((*before, number))
        return wanted

    def _ways(self, trials: Iterable[Trial]) -> dict[str, Numbers]:
        """Return for every node that ran the faults that led there: the fewest, and of those the first."""
        ways: dict[str, Numbers] = {}
        for trial in sorted(trials, key=lambda trial: (len(trial.numbers), trial.numbers)):
            if not self.faults[trial.numbers[-1] - 1].ends_run:
                for path in trial.entered:
                    ways.setdefault(path, trial.numbers)
        return ways

    def _tried(self, wanted: Sequence[Numbers], before: int) -> tuple[list[Trial], bool]:
        """Return the trials, and whether all were done; `before` is how many there are already."""

        def progress(done: int, all: int) -> None:
            if self._progress is not None:
                self._progress(before + done, before + all)

        work = partial(try_out, self.subject, self.rehearsal)
        jobs = [self.these(numbers) for numbers in wanted]
        trials = do_all(jobs, work, _broken, workers=self._workers, progress=progress, halting=self._halting)
        done = [trial for trial in trials if trial is not None and not trial.cut]
        return done, len(done) == len(wanted)


def _broken(faults: Numbered, error: BaseException) -> Trial:
    """Return the trial of a run that left none."""
    problem = f"the run broke: {type(error).__name__}: {error}"
    return replace(empty_trial(faults), status="FAULT", problems=(problem,))


def branches(tree: Node, trials: Iterable[Trial]) -> tuple[Branch, ...]:
    """Return every such way in the order of the tree, and how many of the trials entered each.

    One that stands in a subtree which is used twice is one way with two nodes.
    """
    ran = [trial.entered for trial in trials]
    found: dict[tuple[str, int, int, str], list[str]] = {}
    for mark, what, node in _ways(tree):
        found.setdefault((mark.source.path, mark.line, mark.col, what), []).append(_path(node))
    return tuple(
        Branch(f"{file}:{line}", what, tuple(paths), sum(not entered.isdisjoint(paths) for entered in ran))
        for (file, line, _, what), paths in found.items()
    )


def _ways(tree: Node) -> Iterator[tuple[Mark, str, Node]]:
    for node in tree.walk():
        if isinstance(node, InnerNode):
            for what, child in inspection_instance(node).contingencies():
                yield node_of(child).mark, what, node_of(child)


def _path(node: Node) -> str:
    """Return the path of the node that is built for one: a subtree without a label is what it consists of."""
    while isinstance(node, UseNode) and not node.label and node.body is not None:
        node = node.body
    return node.path
