"""What fault campaigns have shown, as lines of text: a survival matrix, and what no run ever entered."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from itertools import pairwise

from executive.view.figures.fault_trials import FaultFigures, Trial

COLUMNS = ("first", "middle", "late", "lasting")
"""When a fault happens."""


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
    yield f"fault {trial.label}: {'; and '.join(trial.told)}"
    if not trial.happened:
        yield "  one of them found no occasion" if len(trial.told) > 1 else "  it found no occasion"
    ended = " ".join(filter(None, (trial.status, trial.reason)))
    where = f" at {trial.node}" if trial.node else ""
    yield f"  {ended}{where}{f': {trial.message}' if trial.message else ''}"
    yield from (f"  wrong: {problem}" for problem in trial.problems)
