"""Results of fault campaigns, as objects, as JSON values and as text."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise

COLUMNS = ("first", "middle", "late", "lasting")
"""Occasions at which a fault is injected: columns of the table of verdicts."""


@dataclass(frozen=True)
class Trial:
    """One run with injected faults.

    Attributes:
        fault_numbers: Numbers of the injected faults; the last fault is under test, and occurs only if the
            others occurred before.
        descriptions: Description of each fault.
        name: Name of the skill that the last fault affects, or of another affected part of the cell.
        place: File and line of the affected node in the mission, or "".
        what: Failure reason that the last fault should cause, or kind of the fault.
        when: Occasion of the last fault, one of `COLUMNS`.
        happened: True if all faults occurred.
        raised: True if the affected node failed with the expected reason, or if no reason is expected.
        is_halted_by_user: True if the user halted the run.
        status: Status of the run at its end.
        reason: Reason of the status, or "".
        message: Sentence that explains the status, or "".
        node: Path of the node that determined the status, or "".
        missing: Number of objects in bins after a run without faults, minus the number after this run.
        items: Number of items in the ledger by state.
        audit: Number of objects by their true place, or None if there was no audit.
        robot_time: Duration of the run on its clock [s].
        entered_paths: Paths of all nodes that were started.
        problems: Sentences about violated requirements.
        remark: Sentence about questionable but permitted behaviour, or "".
    """

    fault_numbers: tuple[int, ...]
    descriptions: tuple[str, ...]
    name: str
    place: str
    what: str
    when: str
    happened: bool = False
    raised: bool = True
    is_halted_by_user: bool = False
    status: str = ""
    reason: str = ""
    message: str = ""
    node: str = ""
    missing: int = 0
    items: Mapping[str, int] = field(default_factory=dict)
    audit: Mapping[str, int] | None = None
    robot_time: float = 0.0
    entered_paths: frozenset[str] = frozenset()
    problems: tuple[str, ...] = ()
    remark: str = ""

    @property
    def label(self) -> str:
        """Value of the option `--fault` that repeats the trial: `12`, or `3+12`."""
        return "+".join(map(str, self.fault_numbers))

    @property
    def verdict(self) -> str:
        """Short verdict: `!!` for a problem, `-` if a fault did not occur, `ok`, or status and reason."""
        if self.problems:
            return "!!"
        if not self.happened:
            return "-"
        if self.status in ("SUCCESS", "INCOMPLETE"):
            return f"ok -{self.missing}" if self.missing > 0 else "ok"
        if self.status == "FAILURE":
            return f"FAILURE {self.reason}"
        return self.status


@dataclass(frozen=True)
class Branch:
    """A branch of the tree that runs only after a failure, or at the end.

    Attributes:
        place: File and line of the branch in the mission.
        what: Kind of the branch: `catch on Grasp.missed`, `recover`, `choice 2`, `finally`.
        paths: Paths of the root of the branch in the tree; a branch in a subtree that is used twice has two.
        entered: Number of trials that entered the branch.
    """

    place: str
    what: str
    paths: tuple[str, ...]
    entered: int = 0


@dataclass(frozen=True)
class FaultFigures:
    """Results of a fault campaign on one mission.

    Attributes:
        mission: Name of the mission.
        cell: Kind of the cell, and source of the detections.
        seed: Seed of the random numbers.
        robot_time: Duration of a run without faults on its clock [s].
        listed: Number of single faults that can be injected in the mission.
        trials: All trials, in the order of the faults.
        branches: All branches that run only after a failure or at the end, in the order of the tree.
        complete: False if the user ended the campaign before its last run.
        pairs: True if two faults are injected in each run.
    """

    mission: str
    cell: str
    seed: int
    robot_time: float
    listed: int
    trials: tuple[Trial, ...]
    branches: tuple[Branch, ...]
    complete: bool
    pairs: bool = False

    @property
    def failed_trials(self) -> tuple[Trial, ...]:
        """Trials with a problem."""
        return tuple(trial for trial in self.trials if trial.problems)

    @property
    def unentered_branches(self) -> tuple[Branch, ...]:
        """Branches that no trial entered."""
        return tuple(branch for branch in self.branches if not branch.entered)


def results_to_json(figures: FaultFigures) -> dict[str, object]:
    """Return the results as JSON values; times in s."""
    names = ("mission", "cell", "seed", "listed", "pairs", "complete")
    return {
        **{name: getattr(figures, name) for name in names},
        "robot_time_s": figures.robot_time,
        "runs": len(figures.trials),
        "failed": len(figures.failed_trials),
        "branches": [
            {"place": branch.place, "what": branch.what, "entered": branch.entered}
            for branch in figures.branches
        ],
        "trials": [trial_to_json(trial) for trial in figures.trials],
    }


def trial_to_json(trial: Trial) -> dict[str, object]:
    """Return one trial as JSON values; time in s."""
    values = asdict(trial)
    for name in ("fault_numbers", "descriptions", "name", "is_halted_by_user", "entered_paths", "robot_time"):
        del values[name]
    values |= {"fault": trial.label, "verdict": trial.verdict, "robot_time_s": trial.robot_time}
    return {**values, "descriptions": list(trial.descriptions), "problems": list(trial.problems)}


def format_results(figures: FaultFigures) -> str:
    """Return the results of a campaign as a text."""
    return "\n".join(_describe(figures))


def format_trial(trial: Trial) -> str:
    """Return the faults, the end and the problems of one trial as a text."""
    return "\n".join(_describe_trial(trial))


def _describe(figures: FaultFigures) -> Iterator[str]:
    trials = figures.trials
    faults = "pairs of faults" if figures.pairs else "faults"
    yield (
        f"{figures.mission} ({figures.cell}), seed {figures.seed}: {len(trials)} runs with {faults}; "
        f"a run without faults takes {figures.robot_time:.1f} s"
    )
    if not figures.complete:
        yield "  ended by the user before the last run"
    if not figures.pairs:
        yield ""
        yield from _tabulate(trials)
        yield ""
    yield from _count_verdicts(trials)
    yield f"  runs with a problem: {len(figures.failed_trials) or 'none'}"
    for trial in figures.failed_trials:
        yield from (f"    {line}" for line in _describe_trial(trial))
    yield from _list_remarks(trials)
    branches, unentered_branches = figures.branches, figures.unentered_branches
    yield f"  branches after a failure: {len(branches) - len(unentered_branches)} of {len(branches)} entered"
    for branch in unentered_branches:
        yield f"    never entered: {branch.place}: {branch.what}"


def _tabulate(trials: Sequence[Trial]) -> Iterator[str]:
    """Yield the lines of a table of verdicts: a row per node and kind of fault, a column per occasion."""
    trials_by_row: dict[tuple[str, str, str], dict[str, list[Trial]]] = defaultdict(lambda: defaultdict(list))
    for trial in trials:
        trials_by_row[(trial.name, trial.place, trial.what)][trial.when].append(trial)
    rows: list[tuple[str, ...]] = [("node", "place", "fault", *COLUMNS)]
    for heading, columns in sorted(trials_by_row.items(), key=lambda entry: entry[0][:2]):
        rows.append((*heading, *(_summarize(columns.get(column, ())) for column in COLUMNS)))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    all_rows: list[tuple[str, ...]] = [("", "", ""), *rows]
    for previous, row in pairwise(all_rows):
        # Node and place are not repeated.
        texts = row if row[:2] != previous[:2] else ("", "", *row[2:])
        cells = (text.ljust(width) for text, width in zip(texts, widths, strict=True))
        yield f"  {'  '.join(cells).rstrip()}"


def _summarize(trials: Sequence[Trial]) -> str:
    """Return a text with the common verdict, or with the number of `ok` and the most important other one."""
    if not trials:
        return ""
    # Trials without an occurrence of the fault are ignored if the fault occurred in another trial.
    trials = [trial for trial in trials if trial.verdict != "-"] or trials
    verdicts = Counter(trial.verdict for trial in trials)
    if len(verdicts) == 1:
        (verdict,) = verdicts
        return verdict if len(trials) == 1 or verdict == "-" else f"{verdict} {len(trials)}/{len(trials)}"
    ok = verdicts.pop("ok", 0)
    worst = "!!" if "!!" in verdicts else verdicts.most_common(1)[0][0]
    return f"ok {ok}/{len(trials)}, {worst}"


def _count_verdicts(trials: Sequence[Trial]) -> Iterator[str]:
    def count(verdict: str) -> int:
        return sum(trial.verdict == verdict for trial in trials)

    fewer = sum(trial.verdict.startswith("ok -") for trial in trials)
    failed = sum(trial.verdict.startswith("FAILURE") for trial in trials)
    yield (
        f"  as without faults: {count('ok')}; fewer objects sorted: {fewer}; failed: {failed}; "
        f"ended as FAULT: {count('FAULT')}; fault did not occur: {count('-')}; wrong: {count('!!')}"
    )
    reasons = Counter(trial.reason for trial in trials if trial.verdict.startswith("FAILURE"))
    if reasons:
        yield f"  failures: {', '.join(f'{reason} {number}' for reason, number in reasons.most_common())}"


def _list_remarks(trials: Sequence[Trial]) -> Iterator[str]:
    """Yield a line per remark, with the labels of the trials that have it."""
    labels_by_remark: dict[str, list[str]] = defaultdict(list)
    for trial in trials:
        if trial.remark:
            labels_by_remark[trial.remark].append(trial.label)
    if labels_by_remark:
        yield "  failed with another reason than the injected fault should cause:"
    for remark, labels in labels_by_remark.items():
        others = f" and {len(labels) - 3} more" if len(labels) > 3 else ""
        yield f"    {remark}: fault {', '.join(labels[:3])}{others}"


def _describe_trial(trial: Trial) -> Iterator[str]:
    yield f"fault {trial.label}: {'; and '.join(trial.descriptions)}"
    if not trial.happened:
        subject = "one of the faults" if len(trial.descriptions) > 1 else "the fault"
        yield f"  {subject} did not occur"
    end = " ".join(filter(None, (trial.status, trial.reason)))
    node = f" at {trial.node}" if trial.node else ""
    yield f"  {end}{node}{f': {trial.message}' if trial.message else ''}"
    yield from (f"  wrong: {problem}" for problem in trial.problems)
