"""Results of fault campaigns, as values, as JSON and as text."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise

COLUMNS = ("first", "middle", "late", "lasting")
"""Occasions of a fault: columns of the table of verdicts."""


@dataclass(frozen=True)
class Trial:
    """One run with injected faults.

    Attributes:
        numbers: Numbers of the injected faults; the last one is under test, and needs those before it to
            occur.
        descriptions: The faults in words.
        name: Skill of the node that the last fault concerns, or name of another faulty part of the cell.
        place: File and line of that node, or "".
        what: Failure reason that the fault should cause, or kind of the fault.
        when: Occasion of the fault, one of `COLUMNS`.
        happened: True if all faults occurred.
        raised: True if the node failed with the expected reason, or no reason is expected.
        cut: True if the user halted the run.
        status: Status of the run at its end.
        reason: Reason of the status, or "".
        message: One sentence that explains the status, or "".
        node: Path of the node that determined the status, or "".
        missing: Number of objects in bins after an undisturbed run, minus that of this run.
        items: Number of items in the ledger by state.
        audit: True number of objects by place, or None if there was no audit.
        robot_time: Duration of the run on its clock [s].
        entered: Paths of all nodes that were started.
        problems: Sentences about violated requirements.
        remark: Sentence about a doubtful but allowed behaviour, or "".
    """

    numbers: tuple[int, ...]
    descriptions: tuple[str, ...]
    name: str
    place: str
    what: str
    when: str
    happened: bool = False
    raised: bool = True
    cut: bool = False
    status: str = ""
    reason: str = ""
    message: str = ""
    node: str = ""
    missing: int = 0
    items: Mapping[str, int] = field(default_factory=dict)
    audit: Mapping[str, int] | None = None
    robot_time: float = 0.0
    entered: frozenset[str] = frozenset()
    problems: tuple[str, ...] = ()
    remark: str = ""

    @property
    def label(self) -> str:
        """Value of `--fault` that repeats the trial: `12`, or `3+12`."""
        return "+".join(map(str, self.numbers))

    @property
    def verdict(self) -> str:
        """Short verdict: `!!` for a problem, `-` if the fault did not occur, else status and reason."""
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
        place: File and line of the branch.
        what: `catch on Grasp.missed`, `recover`, `choice 2`, `finally`.
        paths: Paths of its nodes in the tree; a subtree that is used twice has two paths.
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
        cell: Kind of its cell, and source of the detections.
        seed: Seed of the random numbers.
        robot_time: Time that an undisturbed run takes on its clock [s].
        listed: Single faults of the mission.
        trials: Every run, in the order of the faults.
        branches: Every branch that runs only after a failure or at the end, in the order of the tree.
        complete: False if the user ended the campaign before its last run.
        pairs: True if each run has two faults.
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
    def failed(self) -> tuple[Trial, ...]:
        """Trials with a problem."""
        return tuple(trial for trial in self.trials if trial.problems)

    @property
    def unentered(self) -> tuple[Branch, ...]:
        """Branches that no trial entered."""
        return tuple(branch for branch in self.branches if not branch.entered)


def as_plain(figures: FaultFigures) -> dict[str, object]:
    """Return the results as plain values; times in s."""
    plain = {
        name: getattr(figures, name) for name in ("mission", "cell", "seed", "listed", "pairs", "complete")
    }
    return {
        **plain,
        "robot_time_s": figures.robot_time,
        "runs": len(figures.trials),
        "failed": len(figures.failed),
        "branches": [
            {"place": branch.place, "what": branch.what, "entered": branch.entered}
            for branch in figures.branches
        ],
        "trials": [trial_as_plain(trial) for trial in figures.trials],
    }


def trial_as_plain(trial: Trial) -> dict[str, object]:
    """Return one trial as plain values."""
    plain = asdict(trial)
    for name in ("numbers", "descriptions", "name", "cut", "entered", "robot_time"):
        del plain[name]
    more = {"fault": trial.label, "verdict": trial.verdict, "robot_time_s": trial.robot_time}
    return {**plain, **more, "descriptions": list(trial.descriptions), "problems": list(trial.problems)}


def fault_text(figures: FaultFigures) -> str:
    """Return the results as lines of text."""
    return "\n".join(_describe(figures))


def trial_text(trial: Trial) -> str:
    """Return the faults, the end and the problems of one trial as text."""
    return "\n".join(_describe_trial(trial))


def _describe(figures: FaultFigures) -> Iterator[str]:
    trials = figures.trials
    faults = "pairs of faults" if figures.pairs else "faults"
    yield (
        f"{figures.mission} ({figures.cell}), seed {figures.seed}: {len(trials)} runs with {faults}; "
        f"undisturbed it takes {figures.robot_time:.1f} s"
    )
    if not figures.complete:
        yield "  ended by the user before the last run"
    if not figures.pairs:
        yield ""
        yield from _tabulate(trials)
        yield ""
    yield from _count_verdicts(trials)
    yield f"  runs with a problem: {len(figures.failed) or 'none'}"
    for trial in figures.failed:
        yield from (f"    {line}" for line in _describe_trial(trial))
    yield from _list_remarks(trials)
    branches, unentered = figures.branches, figures.unentered
    yield f"  branches after a failure: {len(branches) - len(unentered)} of {len(branches)} entered"
    for branch in unentered:
        yield f"    never entered: {branch.place}: {branch.what}"


def _tabulate(trials: Sequence[Trial]) -> Iterator[str]:
    """Yield a table of verdicts: a row per node and fault, a column per occasion."""
    cells: dict[tuple[str, str, str], dict[str, list[Trial]]] = defaultdict(lambda: defaultdict(list))
    for trial in trials:
        cells[(trial.name, trial.place, trial.what)][trial.when].append(trial)
    rows: list[tuple[str, ...]] = [("node", "place", "fault", *COLUMNS)]
    for row, columns in sorted(cells.items(), key=lambda cell: cell[0][:2]):
        rows.append((*row, *(_summarize(columns.get(column, ())) for column in COLUMNS)))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    all_rows: list[tuple[str, ...]] = [("", "", ""), *rows]
    for before, line in pairwise(all_rows):
        shown = line if line[:2] != before[:2] else ("", "", *line[2:])
        cells_of = (text.ljust(width) for text, width in zip(shown, widths, strict=True))
        yield f"  {'  '.join(cells_of).rstrip()}"


def _summarize(trials: Sequence[Trial]) -> str:
    """Return the verdict of one trial, or the number of `ok` and the worst or most frequent other verdict."""
    if not trials:
        return ""
    # Faults that did not occur are left out if others did.
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
        f"  as undisturbed: {count('ok')}; fewer objects sorted: {fewer}; failed: {failed}; "
        f"ended as FAULT: {count('FAULT')}; fault did not occur: {count('-')}; wrong: {count('!!')}"
    )
    ends = Counter(trial.reason for trial in trials if trial.verdict.startswith("FAILURE"))
    if ends:
        yield f"  failures: {', '.join(f'{reason} {number}' for reason, number in ends.most_common())}"


def _list_remarks(trials: Sequence[Trial]) -> Iterator[str]:
    """Yield a line per remark, with the faults of its trials."""
    labels_by_remark: dict[str, list[str]] = defaultdict(list)
    for trial in trials:
        if trial.remark:
            labels_by_remark[trial.remark].append(trial.label)
    if labels_by_remark:
        yield "  failed for another reason than the injected one:"
    for remark, labels in labels_by_remark.items():
        more = f" and {len(labels) - 3} more" if len(labels) > 3 else ""
        yield f"    {remark}: fault {', '.join(labels[:3])}{more}"


def _describe_trial(trial: Trial) -> Iterator[str]:
    yield f"fault {trial.label}: {'; and '.join(trial.descriptions)}"
    if not trial.happened:
        subject = "one of the faults" if len(trial.descriptions) > 1 else "the fault"
        yield f"  {subject} did not occur"
    ended = " ".join(filter(None, (trial.status, trial.reason)))
    where = f" at {trial.node}" if trial.node else ""
    yield f"  {ended}{where}{f': {trial.message}' if trial.message else ''}"
    yield from (f"  wrong: {problem}" for problem in trial.problems)
