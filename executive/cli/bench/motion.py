"""`executive bench motion`: how fast the arm moves, beside other ways to move."""

from __future__ import annotations

from dataclasses import replace

import click

from executive.cli.options import json_option, seed_option
from executive.cli.output import print_json, stdout_kept_clean


@click.command(name="motion")
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
        from executive.view.figures.motion import as_plain, print_figures

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
