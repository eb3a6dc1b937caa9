"""`executive replay`: decide a recorded run once more and say what would be decided otherwise."""

from __future__ import annotations

from pathlib import Path

import click

from executive.cli.options import FILE, json_option, runs_option
from executive.cli.streams import print_json, stdout_kept_clean


@click.command(name="replay")
@click.argument("run", metavar="RUN")
@click.option(
    "--mission", "edited", type=FILE, metavar="FILE",
    help="Decide by another mission file than the one that was run.",
)  # fmt: skip
@runs_option
@json_option
@click.pass_context
def command(ctx: click.Context, run: str, edited: Path | None, runs: Path, as_json: bool) -> None:
    """Decide RUN (a run directory, or `latest`) once more, from what its cell answered then.

    Nothing moves and nothing is simulated: tree, skills and ledger get the recorded answers of arm, tool,
    camera, detectors and operator. Says which decision differs first; exit code 1 if one does.
    """
    with stdout_kept_clean():
        from executive.plugins import discover
        from executive.record.journal import read_journal
        from executive.record.replay import replay
        from executive.record.run_directory import find_run

        path = find_run(run, runs)
        done = replay(path, read_journal(path / "journal.jsonl"), discover(), edited)
        if done.same:
            click.echo(f"{done.decisions} decisions, all as recorded ({path})", err=True)
        else:
            click.echo(f"{done.decisions} decisions as recorded, then {done.difference} ({path})", err=True)
    if as_json:
        print_json({"run": str(path), "same": done.same, **done.as_json()})
    ctx.exit(0 if done.same else 1)
