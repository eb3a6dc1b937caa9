"""Results of a fault campaign, as objects, as JSON values and as text."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from operator import itemgetter
from typing import get_args

from executive.campaign.faults.planned_fault import Occasion, PlannedFault
from executive.events import RunEnded

OCCASIONS: tuple[Occasion, ...] = get_args(Occasion)
"""Occasions of faults; each occasion has a column in the table of verdicts."""


@dataclass(frozen=True, kw_only=True)
class Trial(RunEnded):
    """One run with injected faults: its `RunEnded` event, its faults, and the results of its checks.

    Attributes:
        faults: Injected faults by number. The last fault is under test, and occurs only after all other
            faults.
        have_occurred: True if all faults occurred.
        had_effect: True if the affected node failed with the expected reason, or if no reason is expected.
        is_halted_by_user: True if the user halted the run.
        missing_count: Number of objects in bins after a run without faults, minus the number after this run.
        items: Number of items in the ledger by state.
        audit: Number of objects by their true place, or None if there was no audit.
        entered_paths: Paths of all nodes that were started.
        problems: Sentences about violated requirements.
        remark: Sentence about questionable but permitted behaviour, or "".
    """

    faults: Mapping[int, PlannedFault]
    have_occurred: bool = False
    had_effect: bool = True
    is_halted_by_user: bool = False
    missing_count: int = 0
    items: Mapping[str, int] = field(default_factory=dict)
    audit: Mapping[str, int] | None = None
    entered_paths: frozenset[str] = frozenset()
    problems: tuple[str, ...] = ()
    remark: str = ""

    @property
    def fault_numbers(self) -> tuple[int, ...]:
        """Numbers of the injected faults."""
        return tuple(self.faults)

    @property
    def tested_fault(self) -> PlannedFault:
        """Fault under test."""
        return list(self.faults.values())[-1]

    @property
    def fault_option(self) -> str:
        """Value of the option `--fault` that repeats the trial: `12`, or `3+12`."""
        return "+".join(map(str, self.fault_numbers))

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


@dataclass(frozen=True)
class Branch:
    """A branch of the tree that runs only after a failure, or at the end.

    Attributes:
        mission_line: File and line of the branch in the mission.
        name: Name of the branch: `catch on Grasp.missed`, `recover`, `choice 2`, `finally`.
        trial_count: Number of trials that entered the branch.
    """

    mission_line: str
    name: str
    trial_count: int = 0


@dataclass(frozen=True)
class FaultCampaignResults:
    """Results of a fault campaign on one mission.

    Attributes:
        mission: Name of the mission.
        cell_description: Kind of the cell, and source of the detections, as text.
        seed: Seed of the random numbers.
        robot_time: Duration of a run without faults on its clock [s].
        fault_count: Number of single faults that can be injected into the mission.
        trials: All trials, in the order of the faults.
        branches: All branches that run only after a failure or at the end, in the order of the tree.
        is_complete: False if the user ended the campaign before its last run.
        has_pairs: True if two faults are injected into each run.
    """

    mission: str
    cell_description: str
    seed: int
    robot_time: float
    fault_count: int
    trials: tuple[Trial, ...]
    branches: tuple[Branch, ...]
    is_complete: bool
    has_pairs: bool = False

    @property
    def failed_trials(self) -> tuple[Trial, ...]:
        """Trials with a problem."""
        return tuple(trial for trial in self.trials if trial.problems)

    @property
    def unentered_branches(self) -> tuple[Branch, ...]:
        """Branches that no trial entered."""
        return tuple(branch for branch in self.branches if not branch.trial_count)


def results_to_json(results: FaultCampaignResults) -> dict[str, object]:
    """Return the results of a campaign as JSON values by key; times are in s."""
    return {
        "mission": results.mission, "cell": results.cell_description, "seed": results.seed,
        "listed": results.fault_count, "pairs": results.has_pairs, "complete": results.is_complete,
        "robot_time_s": results.robot_time, "runs": len(results.trials), "failed": len(results.failed_trials),
        "branches": [
            {"place": branch.mission_line, "what": branch.name, "entered": branch.trial_count}
            for branch in results.branches
        ],
        "trials": [trial_to_json(trial) for trial in results.trials],
    }  # fmt: skip


def trial_to_json(trial: Trial) -> dict[str, object]:
    """Return a trial as JSON values by key; times are in s."""
    fault = trial.tested_fault
    return {
        "place": fault.mission_line, "what": fault.kind, "when": fault.occasion,
        "happened": trial.have_occurred, "raised": trial.had_effect, "status": trial.status,
        "reason": trial.reason, "message": trial.message, "node": trial.node, "missing": trial.missing_count,
        "items": trial.items, "audit": trial.audit, "problems": list(trial.problems), "remark": trial.remark,
        "fault": trial.fault_option, "verdict": trial.verdict, "robot_time_s": trial.robot_time,
        "descriptions": list(map(str, trial.faults.values())),
    }  # fmt: skip


def list_result_lines(results: FaultCampaignResults) -> Iterator[str]:
    """Yield the lines of the text about a campaign."""
    trials = results.trials
    faults_text = "pairs of faults" if results.has_pairs else "faults"
    yield (
        f"{results.mission} ({results.cell_description}), seed {results.seed}: {len(trials)} runs with "
        f"{faults_text}; a run without faults takes {results.robot_time:.1f} s"
    )
    if not results.is_complete:
        yield "  ended by the user before the last run"
    if not results.has_pairs:
        yield from ("", *_list_table_lines(trials), "")
    yield from _list_count_lines(trials)
    yield f"  runs with a problem: {len(results.failed_trials) or 'none'}"
    for trial in results.failed_trials:
        yield from (f"    {line}" for line in list_trial_lines(trial))
    yield from _list_remark_lines(trials)
    unentered_branches, branch_count = results.unentered_branches, len(results.branches)
    yield f"  branches after a failure: {branch_count - len(unentered_branches)} of {branch_count} entered"
    for branch in unentered_branches:
        yield f"    never entered: {branch.mission_line}: {branch.name}"


def _list_table_lines(trials: Sequence[Trial]) -> Iterator[str]:
    """Yield the lines of a table of verdicts: a row per node and kind of fault, a column per occasion."""
    trials_by_row: dict[tuple[str, str, str], dict[str, list[Trial]]] = defaultdict(lambda: defaultdict(list))
    for trial in trials:
        fault = trial.tested_fault
        trials_by_row[fault.name, fault.mission_line, fault.kind][fault.occasion].append(trial)
    rows: list[tuple[str, ...]] = [("node", "place", "fault", *OCCASIONS)]
    # The sort is stable, so the faults of a node keep their order.
    for key in sorted(trials_by_row, key=itemgetter(0, 1)):
        rows.append((*key, *(_summarize_verdicts(trials_by_row[key][occasion]) for occasion in OCCASIONS)))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    previous_node = ("", "")
    for part, line, *texts in rows:
        # Only the first row of a node shows the name and the line of the node.
        node = (part, line) if (part, line) != previous_node else ("", "")
        previous_node = part, line
        padded = (text.ljust(width) for text, width in zip((*node, *texts), widths, strict=True))
        yield f"  {'  '.join(padded).rstrip()}"


def _summarize_verdicts(trials: Sequence[Trial]) -> str:
    """Return the verdict that trials share, or the number of `ok` and the most important other verdict."""
    if not trials:
        return ""
    # A trial whose fault did not occur counts only if the fault occurred in no trial.
    trials = [trial for trial in trials if trial.verdict != "-"] or trials
    verdicts = Counter(trial.verdict for trial in trials)
    if len(verdicts) == 1:
        (verdict,) = verdicts
        return verdict if len(trials) == 1 or verdict == "-" else f"{verdict} {len(trials)}/{len(trials)}"
    ok_count = verdicts.pop("ok", 0)
    worst_verdict = "!!" if "!!" in verdicts else verdicts.most_common(1)[0][0]
    return f"ok {ok_count}/{len(trials)}, {worst_verdict}"


def _list_count_lines(trials: Sequence[Trial]) -> Iterator[str]:
    """Yield the number of trials by verdict, and the number of failed trials by reason."""
    counts = Counter(trial.verdict for trial in trials)
    shortfall_count = sum(trial.verdict.startswith("ok -") for trial in trials)
    reasons = Counter(trial.reason for trial in trials if trial.verdict.startswith("FAILURE"))
    yield (
        f"  as without faults: {counts['ok']}; fewer objects sorted: {shortfall_count}; "
        f"failed: {reasons.total()}; ended as FAULT: {counts['FAULT']}; "
        f"fault did not occur: {counts['-']}; wrong: {counts['!!']}"
    )
    if reasons:
        yield f"  failures: {', '.join(f'{reason} {count}' for reason, count in reasons.most_common())}"


def _list_remark_lines(trials: Sequence[Trial]) -> Iterator[str]:
    """Yield a line per remark, with the faults of the first three trials that have the remark."""
    faults_by_remark: dict[str, list[str]] = defaultdict(list)
    for trial in trials:
        if trial.remark:
            faults_by_remark[trial.remark].append(trial.fault_option)
    if faults_by_remark:
        yield "  failed with another reason than the injected fault should cause:"
    for remark, faults in faults_by_remark.items():
        more_text = f" and {len(faults) - 3} more" if len(faults) > 3 else ""
        yield f"    {remark}: fault {', '.join(faults[:3])}{more_text}"


def list_trial_lines(trial: Trial) -> Iterator[str]:
    """Yield the lines of the text about a trial: its faults, its end and its problems."""
    yield f"fault {trial.fault_option}: {'; and '.join(map(str, trial.faults.values()))}"
    if not trial.have_occurred:
        subject = "one of the faults" if len(trial.faults) > 1 else "the fault"
        yield f"  {subject} did not occur"
    status_text = " ".join(filter(None, (trial.status, trial.reason)))
    node_text = f" at {trial.node}" if trial.node else ""
    yield f"  {status_text}{node_text}{f': {trial.message}' if trial.message else ''}"
    yield from (f"  wrong: {problem}" for problem in trial.problems)
