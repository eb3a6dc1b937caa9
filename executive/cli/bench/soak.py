"""`executive bench soak`: a mission run again and again in one process."""

from __future__ import annotations

import click

from executive.cli.options import MISSION, json_option, overrides_option, seed_option
from executive.cli.output import print_json, stdout_kept_clean
from executive.cli.subject import load_subject, oracle_option


@click.command(name="soak")
@MISSION
@click.option("--runs", "count", type=click.IntRange(min=1), default=100, show_default=True, help="How many.")
@click.option("--frames", is_flag=True, help="Save the pictures behind every decision, too.")
@oracle_option
@seed_option
@overrides_option
@json_option
@click.pass_context
def soak(
    ctx: click.Context,
    mission: str,
    count: int,
    frames: bool,
    oracle: bool,
    seed: int,
    overrides: dict[str, str],
    as_json: bool,
) -> None:
    """Run MISSION again and again in one process; exit code 1 if it grows, or a run fails.

    Every run has the next seed and is recorded; its record is deleted after it.
    """
    with stdout_kept_clean():
        from executive.campaign.soak import soak
        from executive.cli.progress import bar
        from executive.view.figures.soak import as_plain, soak_text

        subject = load_subject(mission, overrides, oracle, seed)
        with bar("run", quiet=as_json) as progress:
            figures = soak(subject, count, frames=frames, progress=progress)
    if as_json:
        print_json(as_plain(figures))
    else:
        click.echo(soak_text(figures))
    wrong = bool(figures.problems or figures.failed)
    ctx.exit(int(wrong) if figures.complete else 130)
