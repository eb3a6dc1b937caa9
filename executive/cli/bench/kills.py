"""`executive bench kills`: a mission killed at random moments and taken up again."""

from __future__ import annotations

from pathlib import Path

import click

from executive.cli.options import MISSION, json_option, overrides_option, runs_option, seed_option
from executive.cli.output import print_json, stdout_kept_clean
from executive.cli.subject import load_subject, oracle_option


@click.command(name="kills")
@MISSION
@click.option("--kills", "count", type=click.IntRange(min=1), default=20, show_default=True, help="How many.")
@click.option(
    "--changed", type=click.IntRange(min=0), default=5, show_default=True,
    help="In how many of them the world is changed before the run is taken up again.",
)  # fmt: skip
@oracle_option
@seed_option
@overrides_option
@runs_option
@json_option
@click.pass_context
def kills(
    ctx: click.Context,
    mission: str,
    count: int,
    changed: int,
    oracle: bool,
    seed: int,
    overrides: dict[str, str],
    runs: Path,
    as_json: bool,
) -> None:
    """Kill MISSION at random moments, take it up again each time; exit code 1 if any went wrong.

    The run directories of those are kept; run number n has seed SEED + n.
    """
    with stdout_kept_clean():
        from executive.campaign.kills import kill_often
        from executive.cli.progress import bar
        from executive.view.figures.kill import as_plain, kill_text

        subject = load_subject(mission, overrides, oracle, seed)
        with bar("killed", quiet=as_json) as progress:
            figures = kill_often(
                subject, kills=count, changed=changed, runs=runs / "kills", progress=progress
            )
    if as_json:
        print_json(as_plain(figures))
    else:
        click.echo(kill_text(figures))
    ctx.exit(int(bool(figures.failed)) if figures.complete else 130)
