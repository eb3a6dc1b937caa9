"""Tables of sweeps, and progress bars and reports, on a terminal."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager

import click
from rich import progress
from rich.box import SIMPLE_HEAD
from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from executive.campaign.results import describe_variant
from executive.campaign.sweep_summary import (
    Difference,
    Estimate,
    FailureGroup,
    RunPair,
    VariantSummary,
)
from executive.cli.streams import open_unescaped_stderr
from executive.view.terminal import describe_end


class RateColumn(progress.ProgressColumn):
    """Column of a progress bar with the number of completed parts per minute."""

    def render(self, task: progress.Task) -> Text:
        """Return the content of the column; empty before the first completed part."""
        return Text(f"{60 * task.speed:.1f} per minute" if task.speed else "")


@contextmanager
def show_progress(description: str, *, quiet: bool = False) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar with rate and remaining time if stderr is a terminal; yield the update function.

    The arguments of the update function are the numbers of completed parts and of all parts of the work.

    Args:
        description: Name of the work, beside the bar.
        quiet: True to show nothing.
    """
    console = Console(file=open_unescaped_stderr())
    is_hidden = quiet or not console.is_interactive
    # The remaining time is estimated from all completed parts, because a part may take minutes.
    with progress.Progress(
        progress.TextColumn("{task.description}"), progress.BarColumn(), progress.MofNCompleteColumn(),
        RateColumn(), progress.TimeRemainingColumn(),
        console=console, disable=is_hidden, speed_estimate_period=math.inf,
    ) as bar:  # fmt: skip
        task = bar.add_task(description, total=None)
        yield lambda completed, total: bar.update(task, completed=completed, total=total)


def print_report(lines_and_tables: Iterable[RenderableType]) -> None:
    """Print lines of text, which are not wrapped, and tables to stderr."""
    console = Console(stderr=True, highlight=False, markup=False, force_terminal=False)
    for line_or_table in lines_and_tables:
        console.print(line_or_table, soft_wrap=isinstance(line_or_table, str))


def print_halt() -> None:
    """Print the consequences of the received Ctrl-C or SIGTERM."""
    click.echo("halting: no new runs start, and current runs end", err=True)


MAX_LISTED_SEEDS = 10
"""Maximum number of seeds that are listed for a group of failures."""
MAX_LISTED_CHANGED_SEEDS = 20
"""Maximum number of seeds with a changed outcome that are listed."""


def render_summary(summaries: Sequence[VariantSummary], planned_run_count: int) -> Iterator[RenderableType]:
    """Yield lines and a table with the summary of a sweep of `planned_run_count` runs."""
    run_count = sum(summary.success.denominator for summary in summaries)
    success_count = sum(summary.success.numerator for summary in summaries)
    if run_count == planned_run_count:
        yield f"{success_count} of {run_count} runs succeeded"
    else:
        successes = f"; {success_count} of the {run_count} succeeded" if run_count else ""
        yield f"halted after {run_count} of {planned_run_count} runs{successes}"
    if not summaries:
        return
    yield _make_table(summaries)
    for summary in summaries:
        if summary.variant and summary.failure_groups:
            yield f"with {describe_variant(summary.variant)}:"
        for group in summary.failure_groups:
            yield from _list_failure_lines(group)


def _make_table(summaries: Sequence[VariantSummary]) -> Table:
    """Return a table with a column per variant and a row per metric and skill."""
    table = Table(box=SIMPLE_HEAD, padding=(0, 1))
    table.add_column("(95 % interval)", no_wrap=True)
    for summary in summaries:
        table.add_column(describe_variant(summary.variant) or "all runs", justify="right")
    columns = list(map(_format_metrics, summaries))
    for name in dict.fromkeys(name for column in columns for name in column):
        table.add_row(name, *(column.get(name, "") for column in columns))
    return table


def _format_metrics(summary: VariantSummary) -> dict[str, str]:
    """Return the values of the metrics of a variant as text, by name."""
    objects, robot_time, planning = summary.correct_objects, summary.robot_time_s, summary.planning
    texts = {
        "success rate": _format_percentage(summary.success),
        "objects in the right bin": _format_percentage(objects),
        "number in the right bin": f"{objects.numerator} of {objects.denominator}",
        "ledger and audit agree": _format_percentage(summary.agreement),
        "objects per hour": _format_estimate(summary.objects_per_hour),
        "robot time, median [s]": f"{robot_time.median:.1f}",
        "robot time, range [s]": f"{robot_time.min:.1f} to {robot_time.max:.1f}",
        "wall time, median [s]": f"{summary.wall_time_s.median:.1f}",
        "motions planned ahead": f"{planning.ahead} of {planning.motions}",
        "waits for plans, sum [s]": f"{planning.waited_s:.1f}",
    }
    for skill in summary.skills:
        failures = f"{skill.failed_activations} of {skill.activations} failed"
        texts[f"{skill.skill}, per run [s]"] = f"{skill.mean_robot_time_s:.2f} ({failures})"
    return texts


def _list_failure_lines(group: FailureGroup) -> Iterator[str]:
    """Yield the lines about runs with the same problem."""
    seeds = ", ".join(map(str, group.seeds[:MAX_LISTED_SEEDS]))
    count = len(group.seeds)
    more = f" and {count - MAX_LISTED_SEEDS} more" if count > MAX_LISTED_SEEDS else ""
    runs_text = f"{count} run{'s' * (count > 1)}"
    yield f"{runs_text}: {describe_end(group.status, group.reason, group.node, group.message)}"
    yield f"  seeds {seeds}{more}; repeat the first: {group.repeat_command}"
    # A run whose process crashed has no run directory.
    if group.run_directory:
        yield f"  {group.run_directory}"


def _format_percentage(estimate: Estimate) -> str:
    """Return a proportion and its interval [%]."""
    if estimate.value is None or estimate.low is None or estimate.high is None:
        return "unknown"
    return f"{estimate.value:.2%} ({100 * estimate.low:.1f} to {100 * estimate.high:.1f})"


def _format_estimate(estimate: Estimate) -> str:
    """Return a value and its interval as integers."""
    if estimate.value is None:
        return "unknown"
    interval = "" if estimate.low is None else f" ({estimate.low:.0f} to {estimate.high:.0f})"
    return f"{estimate.value:.0f}{interval}"


def render_differences(
    differences: Sequence[Difference], changed_pairs: Sequence[RunPair], pair_count: int
) -> Iterator[RenderableType]:
    """Yield lines and a table with the differences, and with the seeds whose outcome changed."""
    table = Table("", "A", "B", "B minus A", "95 % interval", box=SIMPLE_HEAD, padding=(0, 1))
    for difference in differences:
        values = (difference.a, difference.b, difference.difference)
        low, high = _format_number(difference.low), _format_number(difference.high)
        interval = "unknown" if difference.low is None else f"{low} to {high}"
        table.add_row(difference.metric, *map(_format_number, values), interval)
    yield f"{pair_count} pairs of runs with the same seed"
    yield table
    yield f"{len(changed_pairs)} seeds with a different outcome"
    for pair in changed_pairs[:MAX_LISTED_CHANGED_SEEDS]:
        texts = [(run.status, run.problem, run.run_directory) for run in (pair.a, pair.b)]
        outcomes = [" ".join(filter(None, run_texts)) for run_texts in texts]
        yield f"  seed {pair.seed}: A {outcomes[0]}; B {outcomes[1]}"
    if len(changed_pairs) > MAX_LISTED_CHANGED_SEEDS:
        yield f"  and {len(changed_pairs) - MAX_LISTED_CHANGED_SEEDS} more; the page lists them"


def _format_number(value: float | None) -> str:
    """Return a number with four significant digits, or `unknown`."""
    return "unknown" if value is None else f"{value:.4g}"
