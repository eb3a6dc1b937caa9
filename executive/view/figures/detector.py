"""The figures of a detector as tables."""

from __future__ import annotations

from collections.abc import Iterator

from rich.box import SIMPLE_HEAD
from rich.console import Console, RenderableType
from rich.table import Table

from executive.training.evaluation.figures import NOTHING, Evaluation


def print_figures(where: str, detector: str, evaluation: Evaluation) -> None:
    """Print how good a detector is on stderr."""
    console = Console(stderr=True, highlight=False, markup=False, force_terminal=False)
    console.print(f"{where}, detector {detector}")
    for part in _parts(detector, evaluation):
        console.print(part, soft_wrap=isinstance(part, str))


def _parts(detector: str, one: Evaluation) -> Iterator[RenderableType]:
    yield f"  {one.objects} objects on {one.images} images, threshold {one.threshold:g}"
    if one.unavailable:
        share = one.unavailable / one.images
        yield f"  unavailable for {one.unavailable} of {one.images} images ({share:.1%}), at last: {one.why}"
    if not one.answered_by:
        return
    if set(one.answered_by) != {detector}:
        yield "  answered by " + ", ".join(f"{name} ({count})" for name, count in one.answered_by.items())
    yield (
        f"  precision {one.precision:.2%}, recall {one.recall:.2%}, "
        f"mAP50 {one.map50:.4f}, mAP50-95 {one.map50_95:.4f}"
    )
    if one.by_class:
        yield _classes(one)
        yield _confusions(one)
    yield _spreads(one)
    if one.reliability is not None:
        yield "  error rates for the ledger (of shares and counts the upper 95 % bound):"
        yield "  " + ", ".join(f"{name} {value:g}" for name, value in one.reliability.rates)
        yield ""


def _classes(one: Evaluation) -> Table:
    """Return the figures of every class."""
    table = _table("class", "objects", "precision", "recall")
    for label, figures in one.by_class.items():
        table.add_row(label, f"{figures.objects}", f"{figures.precision:.2%}", f"{figures.recall:.2%}")
    return table


def _confusions(one: Evaluation) -> Table:
    """Return what the objects of every class were taken for."""
    table = _table("taken for", *next(iter(one.confusion.values())))
    for label, row in one.confusion.items():
        table.add_row(label, *("" if label == found == NOTHING else f"{row[found]}" for found in row))
    return table


def _spreads(one: Evaluation) -> Table:
    """Return how measured quantities are distributed."""
    table = _table("", "median", "95 %", "99 %", "worst")
    for what, spread in (
        ("centre of the box off by [px]", one.centre),
        ("that at the object's height [mm]", one.position),
        ("localized off by [mm]", one.localized),
        ("frame to detections [ms]", one.latency),
    ):
        if spread is not None:
            values = (spread.median, spread.p95, spread.p99, spread.worst)
            table.add_row(what, *(f"{value:.2f}" for value in values))
    return table


def _table(first: str, *headings: str) -> Table:
    """Return a table without rows, words in its first column and numbers in the others."""
    table = Table(box=SIMPLE_HEAD, padding=(0, 1))
    table.add_column(first)
    for heading in headings:
        table.add_column(heading, justify="right")
    return table
