"""`executive bench halts`: a mission halted at moments all over one run."""

from __future__ import annotations

import click

from executive.cli.options import MISSION, json_option, overrides_option, seed_option
from executive.cli.output import print_json, stdout_kept_clean
from executive.cli.subject import load_subject, oracle_option


@click.command(name="halts")
@MISSION
@click.option(
    "--every", type=click.IntRange(min=1),
    help="Control steps from one halt to the next.  [default: 1, of a simulated cell 10]",
)  # fmt: skip
@click.option("--points", type=click.IntRange(min=1), help="So many halts instead, evenly spread.")
@oracle_option
@seed_option
@overrides_option
@json_option
@click.pass_context
def halts(
    ctx: click.Context,
    mission: str,
    every: int | None,
    points: int | None,
    oracle: bool,
    seed: int,
    overrides: dict[str, str],
    as_json: bool,
) -> None:
    """Halt MISSION at moments all over one run, each time as Ctrl-C would; exit code 1 if any went wrong."""
    with stdout_kept_clean():
        from executive.campaign.halts import halt_everywhere
        from executive.cli.progress import bar
        from executive.view.figures.halt import as_plain, halt_text

        subject = load_subject(mission, overrides, oracle, seed)
        every = every or (10 if subject.loaded.cell_config.kind == "sim" else 1)
        with bar("halted", quiet=as_json) as progress:
            figures = halt_everywhere(subject, every=every, points=points, progress=progress)
    if as_json:
        print_json(as_plain(figures))
    else:
        click.echo(halt_text(figures))
    ctx.exit(int(bool(figures.failed)) if figures.complete else 130)
