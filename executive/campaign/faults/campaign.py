"""Campaign of all single faults of a mission, each in a run of its own, or of random pairs."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial

from executive.campaign.faults.fault import PlannedFault
from executive.campaign.faults.listing import list_faults
from executive.campaign.faults.rehearsal import rehearse
from executive.campaign.faults.trial import Numbered, empty_trial, try_out
from executive.campaign.pool import run_jobs
from executive.campaign.subject import Subject
from executive.errors import InputError
from executive.mission.model.instance import inspection_instance, node_of
from executive.mission.model.nodes import InnerNode, Node, UseNode
from executive.mission.source import Mark
from executive.view.figures.fault import Branch, FaultFigures, Trial

MAX_FAULTS_PER_RUN = 4
"""Maximum number of faults in a run whose last fault requires the others."""

Numbers = tuple[int, ...]
"""Numbers of the faults of a run; the last fault is the tested one."""


class Campaign:
    """A mission and its faults.

    Args:
        subject: The mission and its cell.
        workers: Number of processes, which execute one run each.
        progress: Called with the number of finished runs and of all runs.
        halting: Called after the first signal.

    Attributes:
        subject: The mission and its cell.
        rehearsal: Run without a fault.
        faults: All single faults; the number of a fault is its position, from 1.

    Raises:
        ExecutiveError: The mission does not succeed without a fault.
        KeyboardInterrupt: The user halted the rehearsal.
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

    def select(self, numbers: Numbers) -> dict[int, PlannedFault]:
        """Return the faults with these numbers.

        Raises:
            InputError: A number is out of range.
        """
        for number in numbers:
            if not 1 <= number <= len(self.faults):
                raise InputError(
                    f"{self.subject.name} has no fault {number}; the numbers are 1 to {len(self.faults)}, "
                    "and --list shows them"
                )
        return {number: self.faults[number - 1] for number in numbers}

    def try_singles(self) -> FaultFigures:
        """Execute a run for each single fault.

        If a node runs only after other faults, the smallest combination of them is injected, too. If a fault
        of the cell does not provoke its reason, the skill fails with this reason instead.
        """
        trials: dict[Numbers, Trial] = {}
        complete = True
        while complete and (untried := self._list_untried(trials)):
            done, complete = self._try_all(untried, len(trials))
            trials |= {trial.fault_numbers: trial for trial in done}
        ordered = sorted(trials.values(), key=lambda trial: (trial.fault_numbers[-1], trial.fault_numbers))
        return self._figures(ordered, complete, pairs=False)

    def try_pairs(self, count: int) -> FaultFigures:
        """Execute a run for each of `count` random pairs of faults, sampled with the subject's seed.

        Faults that end the run or that require another fault are in no pair.
        """
        numbers = [
            number
            for number, fault in enumerate(self.faults, 1)
            if not (fault.is_conditional or fault.replaced or fault.ends_run)
        ]
        generator, pairs = random.Random(self.subject.seed), dict[Numbers, None]()
        while len(pairs) < min(count, math.comb(len(numbers), 2)):
            pairs[tuple(sorted(generator.sample(numbers, 2)))] = None
        trials, complete = self._try_all(list(pairs), 0)
        return self._figures(trials, complete, pairs=True)

    def _figures(self, trials: Iterable[Trial], complete: bool, *, pairs: bool) -> FaultFigures:
        subject, tried = self.subject, tuple(trials)
        return FaultFigures(
            subject.name, subject.cell, subject.seed, self.rehearsal.robot_time, len(self.faults), tried,
            find_branches(subject.loaded.tree, tried), complete, pairs,
        )  # fmt: skip

    def _list_untried(self, trials: dict[Numbers, Trial]) -> list[Numbers]:
        """Return the faults of the runs that are possible after these trials, and not among them."""
        triggers = self._find_triggers(trials.values())
        tried = {numbers[-1]: trial for numbers, trial in trials.items()}
        untried = []
        for number, fault in enumerate(self.faults, 1):
            if number in tried:
                continue
            if fault.replaced and (fault.replaced not in tried or tried[fault.replaced].raised):
                continue
            required = triggers.get(fault.affected) if fault.is_conditional else ()
            if required is not None and len(required) < MAX_FAULTS_PER_RUN:
                untried.append((*required, number))
        return untried

    def _find_triggers(self, trials: Iterable[Trial]) -> dict[str, Numbers]:
        """Return for each node that ran the smallest set of faults before it, and of equal ones the first."""
        triggers: dict[str, Numbers] = {}
        for trial in sorted(trials, key=lambda trial: (len(trial.fault_numbers), trial.fault_numbers)):
            if not self.faults[trial.fault_numbers[-1] - 1].ends_run:
                for path in trial.entered_paths:
                    triggers.setdefault(path, trial.fault_numbers)
        return triggers

    def _try_all(self, combinations: Sequence[Numbers], offset: int) -> tuple[list[Trial], bool]:
        """Return the trials of the faults, and True if all are complete; `offset` counts earlier trials."""

        def report(done: int, total: int) -> None:
            if self._progress is not None:
                self._progress(offset + done, offset + total)

        work = partial(try_out, self.subject, self.rehearsal)
        jobs = [self.select(numbers) for numbers in combinations]
        trials = run_jobs(
            jobs, work, _fail_job, workers=self._workers, progress=report, halting=self._halting
        )
        done = [trial for trial in trials if trial is not None and not trial.is_halted_by_user]
        return done, len(done) == len(combinations)


def _fail_job(faults: Numbered, error: BaseException) -> Trial:
    """Return the trial of a run that ended with an exception or ended its process."""
    problem = f"the run broke: {type(error).__name__}: {error}"
    return replace(empty_trial(faults), status="FAULT", problems=(problem,))


def find_branches(tree: Node, trials: Iterable[Trial]) -> tuple[Branch, ...]:
    """Return the branches for failures in the order of the tree, with the number of trials that entered each.

    A branch of a subtree that is used twice has two nodes.
    """
    entered = [trial.entered_paths for trial in trials]
    found: dict[tuple[str, int, int, str], list[str]] = {}
    for mark, what, node in _walk_branches(tree):
        found.setdefault((mark.source.path, mark.line, mark.col, what), []).append(_find_path(node))
    return tuple(
        Branch(f"{file}:{line}", what, tuple(paths), sum(not nodes.isdisjoint(paths) for nodes in entered))
        for (file, line, _, what), paths in found.items()
    )


def _walk_branches(tree: Node) -> Iterator[tuple[Mark, str, Node]]:
    """Yield place, name and node of each branch."""
    for node in tree.walk():
        if isinstance(node, InnerNode):
            for what, child in inspection_instance(node).list_contingencies():
                yield node_of(child).mark, what, node_of(child)


def _find_path(node: Node) -> str:
    """Return the path of the built node; a subtree without a label is replaced by its body."""
    while isinstance(node, UseNode) and not node.label and node.body is not None:
        node = node.body
    return node.path
