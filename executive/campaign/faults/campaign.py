"""Fault campaign of a mission: one run for each single fault, or for each of some random pairs."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial

from executive.campaign.faults.fault_list import list_faults
from executive.campaign.faults.nominal_run import execute_nominal_run
from executive.campaign.faults.planned_fault import PlannedFault
from executive.campaign.faults.trial import FaultsByNumber, make_empty_trial, run_trial
from executive.campaign.mission_under_test import MissionUnderTest
from executive.campaign.pool import run_jobs
from executive.errors import InputError
from executive.mission.model.instance import get_mission_node, make_inspection_instance
from executive.mission.model.nodes import InnerNode, Node, UseNode
from executive.mission.source import Mark
from executive.view.results.fault_results import Branch, FaultCampaignResults, Trial

MAX_FAULTS_PER_RUN = 4
"""Maximum number of faults in a run: the fault under test, and the faults that let it occur."""

FaultNumbers = tuple[int, ...]
"""Numbers of the faults of a run; the last fault is under test."""


class Campaign:
    """A fault campaign; the constructor executes the nominal run and lists the faults.

    Args:
        mission: The mission and its cell.
        workers: Number of processes; each executes one run at a time.
        progress: Function that is called with the number of finished runs and the number of all runs.
        on_halt: Function that is called when the first signal (Ctrl-C, SIGTERM) halts the campaign.

    Attributes:
        mission: The mission and its cell.
        nominal_run: Results of the run without a fault.
        faults: All single faults; the number of a fault is its position in the list, from 1.

    Raises:
        ExecutiveError: The mission does not succeed without a fault.
        KeyboardInterrupt: The user halted the nominal run.
    """

    def __init__(
        self,
        mission: MissionUnderTest,
        *,
        workers: int = 2,
        progress: Callable[[int, int], None] | None = None,
        on_halt: Callable[[], None] | None = None,
    ) -> None:
        self.mission = mission
        self.nominal_run = execute_nominal_run(mission)
        self.faults: Sequence[PlannedFault] = list_faults(mission, self.nominal_run)
        self._workers, self._progress, self._on_halt = workers, progress, on_halt

    def select_faults(self, numbers: FaultNumbers) -> dict[int, PlannedFault]:
        """Return the faults with these numbers, by number.

        Raises:
            InputError: A number is out of range.
        """
        for number in numbers:
            if not 1 <= number <= len(self.faults):
                raise InputError(
                    f"{self.mission.name} has no fault {number}; the numbers are 1 to {len(self.faults)}, "
                    "and --list shows them"
                )
        return {number: self.faults[number - 1] for number in numbers}

    def run_single_faults(self) -> FaultCampaignResults:
        """Execute a run for each single fault and return the results.

        If a node runs only after other faults, the smallest set of such faults is injected, too. If a fault
        of the cell does not cause the intended failure, a failure of the skill is injected instead.
        """
        trials: dict[FaultNumbers, Trial] = {}
        complete = True
        while complete and (next_runs := self._list_next_runs(trials)):
            done, complete = self._run_trials(next_runs, len(trials))
            trials |= {trial.fault_numbers: trial for trial in done}
        ordered = sorted(trials.values(), key=lambda trial: (trial.fault_numbers[-1], trial.fault_numbers))
        return self._make_results(ordered, complete, pairs=False)

    def run_fault_pairs(self, count: int) -> FaultCampaignResults:
        """Execute a run for each of `count` random pairs of faults and return the results.

        The seed of the mission determines the pairs. Excluded are faults that end the run, that require
        another fault, or that replace one.
        """
        numbers = [
            number
            for number, fault in enumerate(self.faults, 1)
            if not (fault.is_conditional or fault.replaced_number or fault.ends_run)
        ]
        generator, pairs = random.Random(self.mission.seed), dict[FaultNumbers, None]()
        while len(pairs) < min(count, math.comb(len(numbers), 2)):
            pairs[tuple(sorted(generator.sample(numbers, 2)))] = None
        trials, complete = self._run_trials(list(pairs), 0)
        return self._make_results(trials, complete, pairs=True)

    def _make_results(self, trials: Iterable[Trial], complete: bool, *, pairs: bool) -> FaultCampaignResults:
        mission, done = self.mission, tuple(trials)
        return FaultCampaignResults(
            mission.name, mission.cell_description, mission.seed, self.nominal_run.robot_time,
            len(self.faults), done, find_branches(mission.loaded.tree, done), complete, pairs,
        )  # fmt: skip

    def _list_next_runs(self, trials: dict[FaultNumbers, Trial]) -> list[FaultNumbers]:
        """Return the faults of the next runs, which these trials have made possible."""
        triggers_by_path = self._find_smallest_triggers(trials.values())
        trials_by_number = {numbers[-1]: trial for numbers, trial in trials.items()}
        next_runs = []
        for number, fault in enumerate(self.faults, 1):
            if number in trials_by_number:
                continue
            replaced = trials_by_number.get(fault.replaced_number)
            if fault.replaced_number and (replaced is None or replaced.raised):
                continue
            required = triggers_by_path.get(fault.location) if fault.is_conditional else ()
            if required is not None and len(required) < MAX_FAULTS_PER_RUN:
                next_runs.append((*required, number))
        return next_runs

    def _find_smallest_triggers(self, trials: Iterable[Trial]) -> dict[str, FaultNumbers]:
        """Return for each entered node, by path, the smallest set of faults of a run that entered it."""
        triggers_by_path: dict[str, FaultNumbers] = {}
        for trial in sorted(trials, key=lambda trial: (len(trial.fault_numbers), trial.fault_numbers)):
            if not self.faults[trial.fault_numbers[-1] - 1].ends_run:
                for path in trial.entered_paths:
                    triggers_by_path.setdefault(path, trial.fault_numbers)
        return triggers_by_path

    def _run_trials(self, combinations: Sequence[FaultNumbers], offset: int) -> tuple[list[Trial], bool]:
        """Execute a trial for each combination of faults.

        Return the complete trials, and True if all are complete. `offset` is the number of earlier trials.
        """

        def report(done: int, total: int) -> None:
            if self._progress is not None:
                self._progress(offset + done, offset + total)

        work = partial(run_trial, self.mission, self.nominal_run)
        jobs = [self.select_faults(numbers) for numbers in combinations]
        trials = run_jobs(
            jobs, work, _make_broken_trial, workers=self._workers, progress=report, on_halt=self._on_halt
        )
        done = [trial for trial in trials if trial is not None and not trial.is_halted_by_user]
        return done, len(done) == len(combinations)


def _make_broken_trial(faults: FaultsByNumber, error: BaseException) -> Trial:
    """Return the trial of a run that raised an exception or whose process died."""
    problem = f"the run was aborted: {type(error).__name__}: {error}"
    return replace(make_empty_trial(faults), status="FAULT", problems=(problem,))


def find_branches(tree: Node, trials: Iterable[Trial]) -> tuple[Branch, ...]:
    """Return the branches that run after failures or at the end, with the number of trials that entered them.

    The order is that of the tree. A branch in a subtree that is used twice has two paths.
    """
    entered = [trial.entered_paths for trial in trials]
    paths_by_key: dict[tuple[str, int, int, str], list[str]] = {}
    for mark, name, node in _walk_branches(tree):
        paths_by_key.setdefault((mark.source.path, mark.line, mark.col, name), []).append(_find_path(node))
    return tuple(
        Branch(f"{file}:{line}", name, tuple(paths), sum(not nodes.isdisjoint(paths) for nodes in entered))
        for (file, line, _, name), paths in paths_by_key.items()
    )


def _walk_branches(tree: Node) -> Iterator[tuple[Mark, str, Node]]:
    """Yield the position in the file, the name and the node of each branch."""
    for node in tree.walk():
        if isinstance(node, InnerNode):
            for name, child in make_inspection_instance(node).list_contingencies():
                yield get_mission_node(child).mark, name, get_mission_node(child)


def _find_path(node: Node) -> str:
    """Return the path of a node in the built tree, in which a subtree without a label is only its body."""
    while isinstance(node, UseNode) and not node.label and node.body is not None:
        node = node.body
    return node.path
