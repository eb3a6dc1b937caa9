"""`executive bench`: measurements that other figures rest on."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from executive.cli.options import json_option, seed_option
from executive.cli.output import print_json, stdout_kept_clean

if TYPE_CHECKING:
    from executive.campaign.tick_cost import ChangeCost, SteadyCost


@click.group(name="bench")
def command() -> None:
    """Measure what other figures rest on."""


@command.command(name="seal")
@click.argument("cell", default="overhead")
@click.option(
    "--out", type=click.Path(path_type=Path, dir_okay=False), default=Path("seal_map.csv"), show_default=True,
    help="File to write.",
)  # fmt: skip
def seal(cell: str, out: Path) -> None:
    """Measure how suction cups of several sizes would seal on the objects of CELL, off-centre by how much."""
    with stdout_kept_clean():
        from executive.cli.cells import load_cells
        from executive.errors import InputError
        from executive.sim.seal_map import measure_map, write_map

        (config,) = load_cells((cell,)).values()
        rows = measure_map(config)
        try:
            write_map(rows, out)
        except OSError as error:
            raise InputError(f'cannot write "{out}": {(error.strerror or "").lower()}') from error
        click.echo(f"{len(rows)} rows in {out}", err=True)


@command.command(name="tick")
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


@command.command(name="motion")
@click.argument("cell", default="overhead")
@click.option(
    "--pairs", type=click.IntRange(min=1), default=200, show_default=True,
    help="Random pairs of an object and a place in a bin.",
)  # fmt: skip
@click.option(
    "--execute", "executed", type=click.IntRange(min=0), default=0, show_default=True,
    help="Pairs whose motions the simulated arm makes, watched all the way.",
)  # fmt: skip
@seed_option
@json_option
def motion(cell: str, pairs: int, executed: int, seed: int, as_json: bool) -> None:
    """Measure how fast the arm of CELL moves from bin to object to bin, beside other ways to move."""
    with stdout_kept_clean():
        from executive.campaign.motion_execution import execute
        from executive.campaign.motion_trial import measure
        from executive.cli.cells import load_cells
        from executive.cli.progress import bar
        from executive.view.motion_figures import as_plain, print_figures

        (config,) = load_cells((cell,)).values()
        with bar("planned", quiet=as_json) as progress:
            figures = measure(config, pairs, seed, progress)
        if executed:
            with bar("executed", quiet=as_json) as progress:
                figures = replace(figures, execution=execute(config, executed, seed, progress))
    if as_json:
        print_json(as_plain(figures))
    else:
        print_figures(figures)


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
