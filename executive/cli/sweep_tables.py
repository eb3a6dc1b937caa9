"""Summary of a sweep as text and tables on stderr."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Console, RenderableType
from rich.table import Table

from executive.campaign.results.intervals import Estimate
from executive.campaign.results.sweep_summary import FailureGroup, VariantSummary
from executive.view.terminal.summary import describe_end

MAX_LISTED_SEEDS = 10
"""Maximum number of seeds that are listed for a group of failures."""


def print_summary(summaries: Sequence[VariantSummary], asked: int) -> None:
    """Print the summary of the runs of a sweep in which `asked` runs were requested."""
    console = Console(stderr=True, highlight=False, markup=False, force_terminal=False)
    for line_or_table in _list_lines_and_tables(summaries, asked):
        console.print(line_or_table, soft_wrap=isinstance(line_or_table, str))


def _list_lines_and_tables(summaries: Sequence[VariantSummary], asked: int) -> Iterator[RenderableType]:
    """Yield the lines of text and the tables of the summary."""
    run_count = sum(summary.runs for summary in summaries)
    success_count = sum(summary.succeeded for summary in summaries)
    if run_count == asked:
        yield f"{success_count} of {run_count} runs succeeded"
    else:
        successes = f"; {success_count} of them succeeded" if run_count else ""
        yield f"{run_count} of {asked} runs, halted{successes}"
    if not summaries:
        return
    has_variants = len(summaries) > 1
    yield _make_variant_table(summaries)
    yield _make_phase_table(summaries)
    for summary in summaries:
        if has_variants and summary.failures:
            yield f"with {_describe_variant(summary.variant)}:"
        for group in summary.failures:
            yield from _list_failure_lines(group)


def _make_variant_table(summaries: Sequence[VariantSummary]) -> Table:
    """Return a table with a column per variant and a row per metric, with 95 % intervals."""
    headings = [_describe_variant(each.variant) or "all runs" for each in summaries]
    table = _make_table("(95 % interval)", headings)
    for name, texts in {
        "success": [_format_share(each.success) for each in summaries],
        "objects in the right bin": [f"{each.right} of {each.objects}" for each in summaries],
        "share of these objects": [_format_share(each.right_share) for each in summaries],
        "ledger and audit agree": [_format_share(each.agreement) for each in summaries],
        "objects per hour": [_format_estimate(each.objects_per_hour) for each in summaries],
        "robot time, median [s]": [f"{each.robot_time_s.median:.1f}" for each in summaries],
        "robot time, range [s]": [
            f"{each.robot_time_s.min:.1f} to {each.robot_time_s.max:.1f}" for each in summaries
        ],
        "wall time, median [s]": [f"{each.wall_time_s.median:.1f}" for each in summaries],
        "motions planned ahead": [f"{each.ahead} of {each.motions}" for each in summaries],
        "waited for plans [s]": [f"{each.waited_s:.1f}" for each in summaries],
        "crashed runs": [str(each.crashed) for each in summaries],
    }.items():
        table.add_row(name, *texts)
    return table


def _make_phase_table(summaries: Sequence[VariantSummary]) -> Table:
    """Return a table with a column per variant and a row per skill: mean time per run, and failures."""
    table = _make_table(
        "time per run [s] (failures)", [_describe_variant(each.variant) for each in summaries]
    )
    phases = [{phase.phase: phase for phase in summary.phases} for summary in summaries]
    for name in dict.fromkeys(name for by_name in phases for name in by_name):
        found = (by_name.get(name) for by_name in phases)
        table.add_row(
            name,
            *(
                f"{one.robot_time_s:.2f} ({one.failures} of {one.activations})" if one else ""
                for one in found
            ),
        )
    return table


def _list_failure_lines(group: FailureGroup) -> Iterator[str]:
    """Yield the lines about runs with the same problem."""
    seeds = ", ".join(map(str, group.seeds[:MAX_LISTED_SEEDS]))
    count = len(group.seeds)
    more = f" and {count - MAX_LISTED_SEEDS} more" if count > MAX_LISTED_SEEDS else ""
    runs_text = f"{count} run{'s' * (count > 1)}"
    yield f"{runs_text}: {describe_end(group.status, group.reason, group.node, group.message)}"
    yield f"  seeds {seeds}{more}; repeat the first: {group.repeat}"
    # A run whose process crashed has no run directory.
    if group.run:
        yield f"  {group.run}"


def _describe_variant(variant: Mapping[str, str]) -> str:
    """Return the values of a variant as text."""
    return ", ".join(f"{key}={value}" for key, value in variant.items())


def _format_share(estimate: Estimate) -> str:
    """Return a share and its interval [%]."""
    if estimate.value is None or estimate.low is None or estimate.high is None:
        return "unknown"
    return f"{estimate.value:.2%} ({100 * estimate.low:.1f} to {100 * estimate.high:.1f})"


def _format_estimate(estimate: Estimate) -> str:
    """Return a value and its interval as integers."""
    if estimate.value is None:
        return "unknown"
    interval = "" if estimate.low is None else f" ({estimate.low:.0f} to {estimate.high:.0f})"
    return f"{estimate.value:.0f}{interval}"


def _make_table(row_heading: str, headings: Sequence[str]) -> Table:
    """Return an empty table with a left-aligned column for the names of rows, and right-aligned columns."""
    table = Table(box=SIMPLE_HEAD, padding=(0, 1))
    table.add_column(row_heading, no_wrap=True)
    for heading in headings:
        table.add_column(heading, justify="right")
    return table
