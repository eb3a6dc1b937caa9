"""`executive bench tick`: what ticks and status changes cost."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from executive.cli.options import json_option
from executive.cli.output import print_json, stdout_kept_clean

if TYPE_CHECKING:
    from executive.campaign.tick_cost import ChangeCost, SteadyCost


@click.command(name="tick")
@click.option(
    "--blocks", type=click.IntRange(min=1), default=50, show_default=True,
    help="Measurements of each figure, of which the best counts.",
)  # fmt: skip
@json_option
def tick(blocks: int, as_json: bool) -> None:
    """Measure what ticks and status changes cost, beside the same trees in bare py_trees."""
    with stdout_kept_clean():
        from executive.campaign.tick_cost import change_costs, steady_costs

        steady = steady_costs(blocks)
        with tempfile.TemporaryDirectory() as folder:
            changes = change_costs(blocks, Path(folder))
    if as_json:
        print_json(_figures(steady, changes))
    else:
        click.echo(_text(steady, changes))


def _figures(steady: list[SteadyCost], changes: list[ChangeCost]) -> dict[str, Any]:
    from executive.campaign.tick_cost import MOST_EXTRA, MOST_RATIO

    return {
        "steady": [
            {
                "shape": cost.shape, "nodes": cost.nodes, "ours_us": round(cost.ours, 3),
                "bare_us": round(cost.bare, 3), "ratio": round(cost.ratio, 3),
            }
            for cost in steady
        ],
        "changes": [
            {
                "nodes": cost.nodes, "changes": cost.changes, "ours_us": round(cost.ours, 3),
                "bare_us": round(cost.bare, 3), "extra_us": round(cost.extra, 3),
            }
            for cost in changes
        ],
        "most_ratio": MOST_RATIO,
        "most_extra_us": MOST_EXTRA,
    }  # fmt: skip


def _text(steady: list[SteadyCost], changes: list[ChangeCost]) -> str:
    from executive.campaign.tick_cost import MOST_EXTRA, MOST_RATIO

    lines = [
        f"a tick in the steady state [µs]; ours may cost {MOST_RATIO:g} times the bare one",
        f"{'shape':10}{'nodes':>8}{'ours':>10}{'py_trees':>10}{'ratio':>10}",
    ]
    lines += [
        f"{cost.shape:10}{cost.nodes:8}{cost.ours:10.2f}{cost.bare:10.2f}{cost.ratio:10.2f}"
        for cost in steady
    ]
    lines += [
        "",
        f"a tick in which every node begins and succeeds [µs]; "
        f"a recorded change may cost {MOST_EXTRA:g} more",
        f"{'changes':10}{'nodes':>8}{'ours':>10}{'py_trees':>10}{'extra':>10}",
    ]
    lines += [
        f"{cost.changes:<10}{cost.nodes:8}{cost.ours:10.1f}{cost.bare:10.1f}{cost.extra:10.2f}"
        for cost in changes
    ]
    return "\n".join(lines)
