"""Results of fault campaigns, as values, as JSON and as text."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from typing import Any

COLUMNS = ("first", "middle", "late", "lasting")
"""When a fault happens."""


@dataclass(frozen=True)
class Trial:
    """One run in which something went wrong on purpose.

    Attributes:
        numbers: Of the faults that happened in it, those first that the last one needs to happen at all.
        descriptions: The faults in words.
        name: Skill of the node the last fault is about, or what else it is about.
        place: File and line of that node, or "".
        what: The reason it is to fail with, or what happens.
        when: When that happens.
        happened: Whether all faults found their occasion.
        raised: Whether the node failed with the reason; True where none is meant.
        cut: True where the user halted it.
        status: How the run ended.
        reason: What failed, or "".
        message: One sentence.
        node: Path of the node that decided, or "".
        missing: Objects fewer in bins than in an undisturbed run.
        items: The ledger's balance.
        audit: What really became of the objects.
        robot_time: Time on its clock [s].
        entered: Paths of all nodes that ran.
        problems: What was not as it has to be, in sentences.
        remark: What was odd and may be right, or "".
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
        """Status and reason; `-` if the fault found no occasion."""
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
    """A way on that a mission takes only after a failure, or in the end.

    Attributes:
        place: File and line where it stands.
        what: `catch on Grasp.missed`, `recover`, `choice 2`, `finally`.
        paths: Its nodes in the tree; a subtree that is used twice is there twice.
        entered: How many trials entered it.
    """

    place: str
    what: str
    paths: tuple[str, ...]
    entered: int = 0


@dataclass(frozen=True)
class FaultFigures:
    """A mission in which everything went wrong, one thing at a time, or in pairs.

    Attributes:
        mission: Its name.
        cell: Kind of its cell, and where the detections come from.
        seed: What chance drew from.
        robot_time: Time that an undisturbed run takes on its clock [s].
        listed: Single faults of the mission.
        trials: Every run, in the order of the faults.
        branches: Every way on after a failure, in the order of the tree.
        complete: False where somebody ended the campaign before its last run.
        pairs: True where the runs were to have two faults each.
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
        """The runs that were not as they have to be."""
        return tuple(trial for trial in self.trials if trial.problems)

    @property
    def unentered(self) -> tuple[Branch, ...]:
        """The ways on that no run took."""
        return tuple(branch for branch in self.branches if not branch.entered)


def as_plain(figures: FaultFigures) -> dict[str, Any]:
    """Return the figures as plain values; times in s."""
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


def trial_as_plain(trial: Trial) -> dict[str, Any]:
    """Return one run as plain values."""
    plain = asdict(trial)
    for name in ("numbers", "descriptions", "name", "cut", "entered", "robot_time"):
        del plain[name]
    more = {"fault": trial.label, "verdict": trial.verdict, "robot_time_s": trial.robot_time}
    return {**plain, **more, "told": list(trial.descriptions), "problems": list(trial.problems)}


def fault_text(figures: FaultFigures) -> str:
    """Return the figures as lines of text."""
    return "\n".join(_lines(figures))


def trial_text(trial: Trial) -> str:
    """Return how one run went."""
    return "\n".join(_trial(trial))


def _lines(figures: FaultFigures) -> Iterator[str]:
    trials = figures.trials
    faults = "pairs of faults" if figures.pairs else "faults"
    yield (
        f"{figures.mission} ({figures.cell}), seed {figures.seed}: {len(trials)} runs with {faults}; "
        f"undisturbed it takes {figures.robot_time:.1f} s"
    )
    if not figures.complete:
        yield "  ended by the user; there was more to try"
    if not figures.pairs:
        yield ""
        yield from _matrix(trials)
        yield ""
    yield from _sums(trials)
    yield f"  not as it has to be: {len(figures.failed) or 'none'}"
    for trial in figures.failed:
        yield from (f"    {line}" for line in _trial(trial))
    yield from _remarks(trials)
    all_ways, none = figures.branches, figures.unentered
    yield f"  ways on after a failure: {len(all_ways) - len(none)} of {len(all_ways)} entered"
    for branch in none:
        yield f"    never entered: {branch.place}: {branch.what}"


def _matrix(trials: Sequence[Trial]) -> Iterator[str]:
    """Yield a row per node of the mission and fault, a column per occasion."""
    cells: dict[tuple[str, str, str], dict[str, list[Trial]]] = defaultdict(lambda: defaultdict(list))
    for trial in trials:
        cells[(trial.name, trial.place, trial.what)][trial.when].append(trial)
    rows: list[tuple[str, ...]] = [("node", "place", "fault", *COLUMNS)]
    for row, columns in sorted(cells.items(), key=lambda one: one[0][:2]):
        rows.append((*row, *(_cell(columns.get(column, ())) for column in COLUMNS)))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    listed: list[tuple[str, ...]] = [("", "", ""), *rows]
    for before, line in pairwise(listed):
        shown = line if line[:2] != before[:2] else ("", "", *line[2:])
        cells_of = (text.ljust(width) for text, width in zip(shown, widths, strict=True))
        yield f"  {'  '.join(cells_of).rstrip()}"


def _cell(trials: Sequence[Trial]) -> str:
    """Return what came of some runs: the verdict of one, or how many were ok and what most others were."""
    if not trials:
        return ""
    # What found no occasion tells nothing beside what was tried instead.
    trials = [trial for trial in trials if trial.verdict != "-"] or trials
    verdicts = Counter(trial.verdict for trial in trials)
    if len(verdicts) == 1:
        (verdict,) = verdicts
        return verdict if len(trials) == 1 or verdict == "-" else f"{verdict} {len(trials)}/{len(trials)}"
    ok = verdicts.pop("ok", 0)
    worst = "!!" if "!!" in verdicts else verdicts.most_common(1)[0][0]
    return f"ok {ok}/{len(trials)}, {worst}"


def _sums(trials: Sequence[Trial]) -> Iterator[str]:
    def count(verdict: str) -> int:
        return sum(trial.verdict == verdict for trial in trials)

    fewer = sum(trial.verdict.startswith("ok -") for trial in trials)
    failed = sum(trial.verdict.startswith("FAILURE") for trial in trials)
    yield (
        f"  as undisturbed: {count('ok')}; fewer objects sorted: {fewer}; ended as a failure: {failed}; "
        f"a bug came up: {count('FAULT')}; no occasion: {count('-')}; wrong: {count('!!')}"
    )
    ends = Counter(trial.reason for trial in trials if trial.verdict.startswith("FAILURE"))
    if ends:
        yield f"  failures: {', '.join(f'{reason} {number}' for reason, number in ends.most_common())}"


def _remarks(trials: Sequence[Trial]) -> Iterator[str]:
    """Yield a line per remark, with the faults after which it was made."""
    made: dict[str, list[str]] = defaultdict(list)
    for trial in trials:
        if trial.remark:
            made[trial.remark].append(trial.label)
    if made:
        yield "  failed for another reason than was brought about:"
    for remark, labels in made.items():
        more = f" and {len(labels) - 3} more" if len(labels) > 3 else ""
        yield f"    {remark}: fault {', '.join(labels[:3])}{more}"


def _trial(trial: Trial) -> Iterator[str]:
    yield f"fault {trial.label}: {'; and '.join(trial.descriptions)}"
    if not trial.happened:
        yield "  one of them found no occasion" if len(trial.descriptions) > 1 else "  it found no occasion"
    ended = " ".join(filter(None, (trial.status, trial.reason)))
    where = f" at {trial.node}" if trial.node else ""
    yield f"  {ended}{where}{f': {trial.message}' if trial.message else ''}"
    yield from (f"  wrong: {problem}" for problem in trial.problems)
