"""Fault campaign of a mission: one run for each single fault, or one run for each random pair of faults."""

from __future__ import annotations

import math
import random
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial

from executive.campaign.faults.fault_list import list_faults
from executive.campaign.faults.nominal_run import execute_nominal_run
from executive.campaign.faults.planned_fault import PlannedFault
from executive.campaign.faults.results import Branch, FaultCampaignResults, Trial
from executive.campaign.faults.trial import FaultsByNumber, run_trial
from executive.campaign.mission_under_test import MissionUnderTest
from executive.campaign.pool import JobOptions, run_jobs
from executive.errors import InputError
from executive.mission.model.instance import get_mission_node, make_inspection_instance
from executive.mission.model.nodes import InnerNode, Node, SubtreeNode

MAX_FAULTS_PER_RUN = 4
"""Maximum number of faults in a run: the fault under test, and the faults that activate its node."""

FaultNumbers = tuple[int, ...]
"""Numbers of the faults of a run; the last fault is under test."""


class Campaign:
    """A fault campaign; the constructor executes the nominal run and lists the faults.

    Args:
        mission: The mission and its cell.
        options: Number of processes, and functions that are called during the campaign.

    Attributes:
        nominal_run: Results of the run without a fault.
        faults: All single faults; the number of a fault is its position in this list, from 1.

    Raises:
        ExecutiveError: The mission does not succeed without a fault.
        KeyboardInterrupt: The user halted the nominal run.
    """

    def __init__(self, mission: MissionUnderTest, options: JobOptions = JobOptions()) -> None:
        self.mission = mission
        self.nominal_run = execute_nominal_run(mission)
        self.faults: Sequence[PlannedFault] = list_faults(mission, self.nominal_run)
        self._options = options

    def select_faults(self, numbers: FaultNumbers) -> dict[int, PlannedFault]:
        """Return the faults with these numbers, by number.

        Raises:
            InputError: A number is out of range.
        """
        for number in numbers:
            if not 1 <= number <= len(self.faults):
                advice = f"the numbers are 1 to {len(self.faults)}, and --list shows them"
                raise InputError(f"{self.mission.name} has no fault {number}; {advice}")
        return {number: self.faults[number - 1] for number in numbers}

    def run_single_faults(self) -> FaultCampaignResults:
        """Execute a run for each single fault and return the results.

        If a node runs only after other faults, the smallest combination of faults that activates the node is
        injected, too. If a fault of the cell does not let the node fail, the skill fails in another run.
        """
        trials: list[Trial] = []
        is_complete = True
        while is_complete and (combinations := self._list_next_combinations(trials)):
            ended_trials, is_complete = self._run_trials(combinations, len(trials))
            trials += ended_trials
        trials.sort(key=lambda trial: (trial.fault_numbers[-1], trial.fault_numbers))
        return self._make_results(trials, is_complete=is_complete, has_pairs=False)

    def run_fault_pairs(self, count: int) -> FaultCampaignResults:
        """Execute a run for each of `count` random pairs of faults and return the results.

        The seed of the mission determines the pairs; bugs, conditional and replacing faults are excluded.
        """
        numbers = [
            number
            for number, fault in enumerate(self.faults, 1)
            if not (fault.is_conditional or fault.replaces_previous or fault.is_bug)
        ]
        random_generator, pairs = random.Random(self.mission.seed), dict[FaultNumbers, None]()
        while len(pairs) < min(count, math.comb(len(numbers), 2)):
            pairs[tuple(sorted(random_generator.sample(numbers, 2)))] = None
        trials, is_complete = self._run_trials(list(pairs), 0)
        return self._make_results(trials, is_complete=is_complete, has_pairs=True)

    def _make_results(self, trials: list[Trial], is_complete: bool, has_pairs: bool) -> FaultCampaignResults:
        """Return the results of the campaign."""
        mission, branches = self.mission, find_branches(self.mission.loaded.tree, trials)
        return FaultCampaignResults(
            mission.name, mission.cell_description, mission.seed, self.nominal_run.duration,
            len(self.faults), tuple(trials), branches, is_complete, has_pairs,
        )  # fmt: skip

    def _list_next_combinations(self, trials: Sequence[Trial]) -> list[FaultNumbers]:
        """Return the combinations of faults for the next trials, which can occur according to `trials`."""
        triggers_by_path = self._find_smallest_triggers(trials)
        trials_by_number = {trial.fault_numbers[-1]: trial for trial in trials}
        combinations = []
        for number, fault in enumerate(self.faults, 1):
            if number in trials_by_number:
                continue
            previous_trial = trials_by_number.get(number - 1)
            if fault.replaces_previous and (previous_trial is None or previous_trial.had_effect):
                continue
            required_faults = triggers_by_path.get(fault.location) if fault.is_conditional else ()
            if required_faults is not None and len(required_faults) < MAX_FAULTS_PER_RUN:
                combinations.append((*required_faults, number))
        return combinations

    def _find_smallest_triggers(self, trials: Iterable[Trial]) -> dict[str, FaultNumbers]:
        """Return the smallest combination of faults that activated a node, by path of the node."""
        triggers_by_path: dict[str, FaultNumbers] = {}
        for trial in sorted(trials, key=lambda trial: (len(trial.fault_numbers), trial.fault_numbers)):
            if not self.faults[trial.fault_numbers[-1] - 1].is_bug:
                for path in trial.entered_paths:
                    triggers_by_path.setdefault(path, trial.fault_numbers)
        return triggers_by_path

    def _run_trials(self, combinations: Sequence[FaultNumbers], offset: int) -> tuple[list[Trial], bool]:
        """Execute a trial for each combination of faults; `offset` is the number of earlier trials.

        Return the complete trials, and True if all trials are complete.
        """

        def report(ended_count: int, total: int) -> None:
            self._options.on_progress(offset + ended_count, offset + total)

        jobs = list(map(self.select_faults, combinations))
        run_job = partial(run_trial, self.mission, self.nominal_run)
        trials = run_jobs(jobs, run_job, _make_aborted_trial, replace(self._options, on_progress=report))
        complete_trials = [trial for trial in trials if trial is not None and not trial.is_halted_by_user]
        return complete_trials, len(complete_trials) == len(combinations)


def _make_aborted_trial(faults: FaultsByNumber, error: BaseException) -> Trial:
    """Return the trial of a run that raised an exception or whose process died."""
    problem = f"the run was aborted: {type(error).__name__}: {error}"
    return Trial("FAULT", "", "", "", False, "", 0, 0.0, faults=faults, problems=(problem,))


def find_branches(tree: Node, trials: Sequence[Trial]) -> tuple[Branch, ...]:
    """Return the branches that run only after failures or at the end, in the order of the tree.

    A branch in a subtree that is used twice has two paths.
    """
    paths_by_place: dict[tuple[str, int, int, str], list[str]] = defaultdict(list)
    for node in tree.walk():
        if isinstance(node, InnerNode):
            for name, child in make_inspection_instance(node).list_contingencies():
                branch = get_mission_node(child)
                place = branch.span.source.path, branch.span.line, branch.span.col, name
                paths_by_place[place].append(_find_path(branch))
    branches = []
    for (file, line, _, name), paths in paths_by_place.items():
        trial_count = sum(not trial.entered_paths.isdisjoint(paths) for trial in trials)
        branches.append(Branch(f"{file}:{line}", name, trial_count))
    return tuple(branches)


def _find_path(node: Node) -> str:
    """Return the path of a node in the built tree, which contains no node for a use without a label."""
    while isinstance(node, SubtreeNode) and not node.label and node.body is not None:
        node = node.body
    return node.path
