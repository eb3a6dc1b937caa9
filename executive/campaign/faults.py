"""Fault campaign of a mission: one run for each single fault, or one run for each random pair of faults."""

from __future__ import annotations

import math
import random
import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path

from executive.campaign.fault_list import INJECTED_MESSAGE, FaultLister, PlannedFault, SkillFault
from executive.campaign.jobs import JobOptions, MissionUnderTest, run_jobs
from executive.errors import InputError
from executive.events import RunEnded
from executive.ledger.final_states import is_balanced
from executive.mission.analysis import UnhandledFailure
from executive.record.journal import Recorder
from executive.record.recorded_run import execute_recorded, make_run_directory
from executive.record.result import is_confirmed_by_audit
from executive.record.timeline import Timeline, group_by_node
from executive.run.assembly import RunOptions, assemble
from executive.skill import Skill
from executive.testing.faulty_cell import FaultInjector
from executive.tree.node import ControlNode
from executive.tree.specification import SubtreeNode
from executive.view.report import try_write_report
from executive.view.terminal import describe_end

MAX_FAULTS_PER_RUN = 4
"""Maximum number of faults in a run: the fault under test, and the faults that activate its node."""
MIN_TIMEOUT = 60.0
"""Minimum timeout of a run with faults, on the run's clock [s]."""
TIMEOUT_FACTOR = 10.0
"""Additional timeout of a run with faults, as a multiple of the duration of the run without faults."""
DISPLACING_EFFECTS = frozenset({"object_removed", "object_moved", "grip_lost"})
"""Values of `FaultInjected.name` for the faults that may move an object out of reach of the arm."""

FaultNumbers = tuple[int, ...]
"""Numbers of the faults of a run; the last fault is under test, and the earlier faults activate its node."""
FaultsByNumber = Mapping[int, PlannedFault]
"""Faults of a run by number, in the same order."""


@dataclass(frozen=True, kw_only=True)
class Trial(RunEnded):
    """One run with injected faults: its `RunEnded` event, its faults, and the results of its checks.

    Attributes:
        faults: Injected faults by number. The last fault is under test, and occurs only after all others.
        have_occurred: True if all faults occurred.
        had_effect: True if the affected node failed with the expected reason, or if no reason is expected.
        items: Number of items in the ledger by state.
        audit: Number of objects by their true place, or None if there was no audit.
        missing_count: Number of objects in bins after a run without faults, minus the number after this run.
        steps_by_path: Number of control steps of each activation of a node, by path of the node.
        run_directory: Path of the directory of a recorded run, or "".
        problems: Sentences about violated requirements.
    """

    faults: FaultsByNumber
    have_occurred: bool = False
    had_effect: bool = True
    items: Mapping[str, int] = field(default_factory=dict)
    audit: Mapping[str, int] | None = None
    missing_count: int = 0
    steps_by_path: Mapping[str, Sequence[int]] = field(default_factory=dict)
    run_directory: str = ""
    problems: tuple[str, ...] = ()

    @property
    def fault_option(self) -> str:
        """Value of the option `--fault` that repeats the trial: `12`, or `3+12`."""
        return "+".join(map(str, self.faults))

    @property
    def verdict(self) -> str:
        """Verdict: `!!` (problem), `-` (fault did not occur), `ok`, `ok -N` (N objects fewer), or status."""
        if self.problems:
            return "!!"
        if not self.have_occurred:
            return "-"
        if self.status in ("SUCCESS", "INCOMPLETE"):
            return f"ok -{self.missing_count}" if self.missing_count > 0 else "ok"
        return f"FAILURE {self.reason}" if self.status == "FAILURE" else self.status


class Campaign:
    """A fault campaign; the constructor executes the mission without a fault and lists the faults.

    Args:
        mission: The mission and its cell.
        options: Number of processes, and functions that are called during the campaign.

    Attributes:
        mission: The mission and its cell.
        nominal_run: The run without a fault.
        faults: All single faults; the number of a fault is its position in this list, from 1.
        trials: All trials, in the order of the faults.
        is_complete: False if the user ended the campaign before its last run.

    Raises:
        InputError: The mission does not succeed without a fault, or ledger and ground truth disagree.
        KeyboardInterrupt: The user halted the run without a fault.
    """

    def __init__(self, mission: MissionUnderTest, options: JobOptions = JobOptions()) -> None:
        self.mission = mission
        self._options = options
        self.nominal_run = run = run_trial(mission, {})
        if run.status == "HALTED":
            raise KeyboardInterrupt
        if run.status != "SUCCESS" or run.problems or (run.audit and run.audit["unseen"]):
            end_text = " ".join((run.status, run.reason, run.message, *run.problems))
            problem = f"without a fault, {mission.name} with seed {mission.seed} ends as {end_text}"
            advice = "choose another seed or mission, whose run succeeds and observes the whole table"
            raise InputError(f"{problem}; {advice}")
        if run.audit is None:
            problem = (
                f"a campaign compares ledger and true objects, which the driver of {mission.name} does not"
            )
            raise InputError(f"{problem} know; add --set cell.kind=fake, or --cell with a simulated cell")
        self.faults = list(FaultLister(mission, run.steps_by_path, run.robot_time).list_faults())
        self.trials: list[Trial] = []
        self.is_complete = True

    def select_faults(self, numbers: FaultNumbers) -> dict[int, PlannedFault]:
        """Return the faults with these numbers, by number.

        Raises:
            InputError: A number is out of range.
        """
        for number in numbers:
            if not 1 <= number <= len(self.faults):
                numbers_text = f"the numbers are 1 to {len(self.faults)}, and --list shows them"
                raise InputError(f"{self.mission.name} has no fault {number}; {numbers_text}")
        return {number: self.faults[number - 1] for number in numbers}

    def run_single_faults(self) -> None:
        """Execute a run for each single fault.

        If a node runs only after other faults, the smallest combination of faults that activates the node is
        injected, too. If a fault of the cell does not let the node fail, the skill fails in another run.
        """
        while self.is_complete and (combinations := self._list_next_combinations()):
            self._run_trials(combinations)
        self.trials.sort(key=lambda trial: tuple(reversed(trial.faults)))

    def run_fault_pairs(self, count: int) -> None:
        """Execute a run for each of `count` random pairs of faults.

        The seed of the mission determines the pairs; bugs, conditional and replacing faults are excluded.
        """
        numbers = [
            number
            for number, fault in enumerate(self.faults, 1)
            if not (fault.is_conditional or fault.replaces_previous or fault.is_bug)
        ]
        random_generator = random.Random(self.mission.seed)
        pairs: dict[FaultNumbers, None] = {}
        while len(pairs) < min(count, math.comb(len(numbers), 2)):
            pairs[tuple(sorted(random_generator.sample(numbers, 2)))] = None
        self._run_trials(list(pairs))

    def _list_next_combinations(self) -> list[FaultNumbers]:
        """Return the combinations for the next trials, which can occur according to the trials so far."""
        # The smallest combination of faults that activated a node, by path of the node.
        triggers_by_path: dict[str, FaultNumbers] = {}
        trials_by_number: dict[int, Trial] = {}
        for trial in sorted(self.trials, key=lambda trial: (len(trial.faults), tuple(trial.faults))):
            number = list(trial.faults)[-1]
            trials_by_number[number] = trial
            if not self.faults[number - 1].is_bug:
                for path in trial.steps_by_path:
                    triggers_by_path.setdefault(path, tuple(trial.faults))
        combinations = []
        for number, fault in enumerate(self.faults, 1):
            previous_trial = trials_by_number.get(number - 1)
            is_replaced = fault.replaces_previous and (previous_trial is None or previous_trial.had_effect)
            triggers = triggers_by_path.get(fault.location) if fault.is_conditional else ()
            if number in trials_by_number or is_replaced or triggers is None:
                continue
            if len(triggers) < MAX_FAULTS_PER_RUN:
                combinations.append((*triggers, number))
        return combinations

    def _run_trials(self, combinations: Sequence[FaultNumbers]) -> None:
        jobs = list(map(self.select_faults, combinations))
        run_job = partial(run_trial, self.mission, nominal_run=self.nominal_run)
        trials = run_jobs(jobs, run_job, _make_aborted_trial, self._options)
        complete_trials = [trial for trial in trials if trial is not None and trial.status != "HALTED"]
        self.trials += complete_trials
        self.is_complete = len(complete_trials) == len(combinations)


def _make_aborted_trial(faults: FaultsByNumber, error: BaseException) -> Trial:
    """Return the trial of a run that raised an exception or whose process died."""
    problem = f"the run was aborted: {type(error).__name__}: {error}"
    return Trial("FAULT", "", "", "", False, "", 0, 0.0, faults=faults, problems=(problem,))


def run_trial(
    mission: MissionUnderTest, faults: FaultsByNumber, nominal_run: Trial | None = None,
    runs_folder: Path | None = None,
) -> Trial:  # fmt: skip
    """Execute a mission with these faults and return the trial.

    Args:
        mission: The mission and its cell.
        faults: Faults of the run.
        nominal_run: The run without faults; None if this is the run without faults.
        runs_folder: Folder below which the run is recorded; None: the run is not recorded.

    Raises:
        InputError: The run directory cannot be created.
        ExecutiveError: The result cannot be written.
    """
    start_time = time.perf_counter()
    loaded = mission.loaded
    cell_faults = []
    substitutes: dict[str, type[Skill]] = {}
    for fault in faults.values():
        if isinstance(fault.injected, SkillFault):
            skill = substitutes.get(fault.location, loaded.skills[fault.injected.skill])
            substitutes[fault.location] = fault.injected.make_skill(skill)
        else:
            cell_faults.append(fault.injected)
    timeout = MIN_TIMEOUT + TIMEOUT_FACTOR * nominal_run.robot_time if nominal_run else math.inf
    injector = FaultInjector(cell_faults, timeout)
    make_cell = injector.wrap(mission.make_cell)
    options = RunOptions(mission.seed, mission.requests, make_cell=make_cell, substitutes=substitutes)
    timeline = Timeline()
    run_directory = ""
    with closing(assemble(loaded, options, [timeline])) as run:
        station = run.station
        run.add_observer(injector.on_event)
        if runs_folder is None:
            run.execute()
        else:
            directory = make_run_directory(run, loaded, options, runs_folder)
            recorder = Recorder(directory)
            run_directory = execute_recorded(run, loaded, recorder, mission.seed, start_time).run
            try_write_report(run_directory)
        items = station.ledger.count_states()
        audit = station.audit()
        is_arm_at_rest = station.cell.arm.at_rest
        is_holding = station.cell.tool.holding
    end = timeline.ended
    assert end is not None, "every run emits its end"
    activations_by_path = group_by_node(timeline.activations)
    effect_names = [name for _, name in timeline.faults]

    def has_effect(fault: PlannedFault) -> bool:
        return any(map(fault.is_cause_of, activations_by_path.get(fault.location, ())))

    def has_occurred(fault: PlannedFault) -> bool:
        if isinstance(fault.injected, SkillFault):
            return has_effect(fault)
        return fault.injected.effect.name in effect_names

    raised_bugs = [fault.location for fault in faults.values() if fault.is_bug and has_effect(fault)]
    problems = [*check_end(end, raised_bugs, loaded.unhandled_failures)]
    if audit is not None:
        problems += check_ledger(end, items, audit, effect_names)
    if not is_arm_at_rest:
        problems.append("the arm is not at rest")
    if is_holding != bool(end.held_item):
        tool_text = "holds an object" if is_holding else "is empty"
        problems.append(f'the tool {tool_text}, but the held item of the run is "{end.held_item}"')
    return Trial(
        **asdict(end),
        faults=faults,
        have_occurred=all(map(has_occurred, faults.values())),
        had_effect=all(has_effect(fault) for fault in list(faults.values())[-1:] if fault.is_failure_reason),
        items=items,
        audit=audit,
        missing_count=nominal_run.items["placed"] - items["placed"] if nominal_run else 0,
        steps_by_path={
            path: [each.end_tick - each.start_tick for each in activations]
            for path, activations in activations_by_path.items()
        },
        run_directory=run_directory,
        problems=tuple(problems),
    )


def check_end(
    end: RunEnded, raised_bugs: Sequence[str], unhandled_failures: Sequence[UnhandledFailure]
) -> Iterator[str]:
    """Yield a problem if the run did not end as its faults require.

    Args:
        end: End of the run.
        raised_bugs: Nodes whose injected error was raised; the run must then end as FAULT at such a node.
        unhandled_failures: Failures with which the mission may end, according to the check of the mission.
    """
    if end.status == "FAULT":
        if end.node not in raised_bugs or INJECTED_MESSAGE not in end.message:
            yield f"the run ended as FAULT at {end.node or 'no node'}: {end.message}"
    elif raised_bugs:
        yield f"the injected error was raised, but the run ended as {end.status} {end.reason}"
    if end.status == "FAILURE" and end.reason != "lost":
        ends = {(failure.node, f"{failure.source}.{failure.reason}") for failure in unhandled_failures}
        if (end.node, end.reason) not in ends:
            yield f"the run ended with {end.reason} at {end.node}; `check` lists no such end"


def check_ledger(
    end: RunEnded, items: Mapping[str, int], audit: Mapping[str, int], effects: Sequence[str]
) -> Iterator[str]:
    """Yield a problem if the ledger does not balance, an object is misplaced, or the audit disagrees.

    If the run ended early or lost an item, the ledger may lack objects, and dropped items may count as lost.

    Args:
        end: End of the run.
        items: Number of items in the ledger, by state.
        audit: True object counts by `AUDIT_KEYS`, for instance `left` for the table.
        effects: Names of the effects that occurred. The ledger may count a removed object as lost, or still
            contain it.
    """
    books = f"the ledger says {items}; the audit {audit}"
    if not is_balanced(items):
        yield f"the ledger does not balance: {books}"
    if audit["wrong_bin"]:
        yield f"{audit['wrong_bin']} objects in wrong bins; {books}"
    displaced_count = sum(name in DISPLACING_EFFECTS for name in effects)
    if audit["elsewhere"] > displaced_count:
        yield f"{audit['elsewhere']} objects are out of reach, but the faults displaced {displaced_count}"
    unnoticed_count = min(max(audit["elsewhere"] - items["lost"], 0), effects.count("object_removed"))
    left_count = audit["left"] + unnoticed_count
    if end.status == "FAULT" or end.node or items["lost"]:
        unplaced_count = items["rejected"] + items["skipped"]
        is_confirmed = items["placed"] <= audit["right"] and unplaced_count <= left_count
    else:
        places = {**audit, "left": left_count, "elsewhere": audit["elsewhere"] - unnoticed_count}
        is_confirmed = is_confirmed_by_audit(items, places, end.is_table_empty)
    if not is_confirmed:
        yield books


def count_branch_entries(campaign: Campaign) -> dict[str, int]:
    """Return the number of trials that entered each branch after a failure or at the end.

    The keys are file, line and name of the branch, in the order of the tree. A branch in a subtree that is
    used twice has two paths.
    """
    paths_by_branch: dict[str, set[str]] = defaultdict(set)
    for node in campaign.mission.loaded.tree.walk():
        if isinstance(node, ControlNode):
            for name, branch in node.list_contingencies():
                key = f"{branch.span.source.path}:{branch.span.line}:{branch.span.col}: {name}"
                # The built tree contains no node for the use of a subtree without a label.
                while isinstance(branch, SubtreeNode) and not branch.label and branch.body is not None:
                    branch = branch.body
                paths_by_branch[key].add(branch.path)
    return {
        branch: sum(not paths.isdisjoint(trial.steps_by_path) for trial in campaign.trials)
        for branch, paths in paths_by_branch.items()
    }


def results_to_json(campaign: Campaign) -> dict[str, object]:
    """Return the results of a campaign as JSON values by key; times are in s."""
    mission = campaign.mission
    return {
        "mission": mission.name, "cell": mission.cell_description, "seed": mission.seed,
        "robot_time_s": campaign.nominal_run.robot_time, "complete": campaign.is_complete,
        "branches": count_branch_entries(campaign), "trials": list(map(trial_to_json, campaign.trials)),
    }  # fmt: skip


def trial_to_json(trial: Trial) -> dict[str, object]:
    """Return a trial as JSON values by key; times are in s."""
    values = {name: value for name, value in vars(trial).items() if name not in ("faults", "steps_by_path")}
    faults = list(map(str, trial.faults.values()))
    return {"fault": trial.fault_option, "faults": faults, "verdict": trial.verdict, **values}


def list_result_lines(campaign: Campaign) -> Iterator[str]:
    """Yield the lines of the text about a campaign: verdicts by node and fault, problems, unused branches."""
    mission = campaign.mission
    yield (
        f"{mission.name} ({mission.cell_description}), seed {mission.seed}: {len(campaign.trials)} runs with "
        f"faults; a run without faults takes {campaign.nominal_run.robot_time:.1f} s"
    )
    if not campaign.is_complete:
        yield "  ended by the user before the last run"
    verdicts_by_fault: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    for trial in campaign.trials:
        tested_fault = list(trial.faults.values())[-1]
        verdicts_by_fault[tested_fault.name, tested_fault.kind][trial.verdict] += 1
    for (name, kind), verdicts in verdicts_by_fault.items():
        texts = [f"{verdict} ({count})" for verdict, count in verdicts.most_common()]
        yield f"  {name:40} {kind:30} {', '.join(texts)}"
    failed_trials = [trial for trial in campaign.trials if trial.problems]
    yield f"  runs with a problem: {len(failed_trials) or 'none'}"
    for trial in failed_trials:
        yield from (f"    {line}" for line in list_trial_lines(trial))
    branches = count_branch_entries(campaign)
    unentered_branches = [branch for branch, count in branches.items() if not count]
    yield f"  branches after a failure: {len(branches)}, never entered: {len(unentered_branches)}"
    yield from (f"    never entered: {branch}" for branch in unentered_branches)


def list_trial_lines(trial: Trial) -> Iterator[str]:
    """Yield the lines of the text about a trial: its faults, its end and its problems."""
    yield f"fault {trial.fault_option}: {'; and '.join(map(str, trial.faults.values()))}"
    if not trial.have_occurred:
        yield "  not all of these faults occurred"
    yield f"  {describe_end(trial.status, trial.reason, trial.node, trial.message)}"
    yield from (f"  wrong: {problem}" for problem in trial.problems)
    if trial.run_directory:
        yield trial.run_directory
