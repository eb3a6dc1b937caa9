"""Differences of a comparison as a table on stderr."""

from __future__ import annotations

from collections.abc import Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from executive.campaign.results.differences import Difference, RunPair

MAX_LISTED_SEEDS = 20
"""Maximum number of seeds with a changed outcome that are listed."""


def print_differences(differences: Sequence[Difference], changed: Sequence[RunPair], pair_count: int) -> None:
    """Print the differences, and the seeds whose outcome changed."""
    console = Console(stderr=True, highlight=False, markup=False, force_terminal=False)
    table = Table("", "A", "B", "B minus A", "95 % interval", box=SIMPLE_HEAD, padding=(0, 1))
    for each in differences:
        texts = [
            "unknown" if value is None else f"{value:.4g}" for value in (each.a, each.b, each.difference)
        ]
        interval = (
            "unknown" if each.low is None or each.high is None else f"{each.low:.4g} to {each.high:.4g}"
        )
        table.add_row(each.metric, *texts, interval)
    console.print(f"{pair_count} pairs of runs with the same seed")
    console.print(table)
    console.print(f"{len(changed)} seeds with a different outcome")
    for pair in changed[:MAX_LISTED_SEEDS]:
        outcomes = [" ".join(filter(None, (run.status, run.problem, run.run))) for run in (pair.a, pair.b)]
        console.print(f"  seed {pair.seed}: A {outcomes[0]}; B {outcomes[1]}", soft_wrap=True)
    if len(changed) > MAX_LISTED_SEEDS:
        console.print(f"  and {len(changed) - MAX_LISTED_SEEDS} more; the page lists them")
