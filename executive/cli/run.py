"""`executive run`: run a mission once."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from executive.cli.options import MISSION, json_option, overrides_option, runs_option, seed_option
from executive.cli.output import print_json, stdout_kept_clean

if TYPE_CHECKING:
    from executive.view.lines import Lines
    from executive.view.terminal import Terminal


@click.command(name="run")
@MISSION
@seed_option
@overrides_option
@runs_option
@json_option
@click.option("--quiet", is_flag=True, help="Show nothing while running.")
@click.option("--gui", is_flag=True, help="Open the simulator's window.")
@click.option("--realtime", is_flag=True, help="Run on the wall clock instead of as fast as possible.")
@click.option(
    "--request", "requests", metavar="CLASS", multiple=True, help="Asked for by the operator; repeatable."
)
@click.pass_context
def command(
    ctx: click.Context,
    mission: str,
    seed: int,
    overrides: dict[str, str],
    runs: Path,
    as_json: bool,
    quiet: bool,
    gui: bool,
    realtime: bool,
    requests: tuple[str, ...],
) -> None:
    """Run MISSION (a file or the name of a shipped mission) and record it."""
    if gui and not os.environ.get("DISPLAY"):
        # The simulator would end the process with a line of its own.
        raise click.UsageError("--gui needs a display, and DISPLAY names none; leave it out")
    with stdout_kept_clean():
        from executive.mission.load import load_mission
        from executive.record.recorded_run import recorded_run
        from executive.record.result import EXIT_CODES
        from executive.runtime.cells import cell_kind
        from executive.skill import discover
        from executive.view.summary import repeat_command, summary

        skills = discover()
        loaded = load_mission(mission, skills, overrides, cell_kind)
        view = None if quiet else _view()
        if view is not None:
            for warning in loaded.warnings:
                click.echo(str(warning), err=True)
        result = recorded_run(
            loaded, skills, seed=seed, runs=runs, view=view, gui=gui, realtime=realtime,
            requests=requests or None,
        )  # fmt: skip
        if view is not None:
            repeat = repeat_command(mission, seed=seed, overrides=overrides, requests=requests)
            click.echo(summary(result, view.items, repeat), err=True, nl=False)
    if as_json:
        print_json(result)
    ctx.exit(EXIT_CODES[result["status"]])


def _view() -> Lines | Terminal:
    """Return the live view where a person watches a terminal, plain lines elsewhere."""
    from rich.console import Console

    from executive.view.lines import Lines
    from executive.view.terminal import Terminal

    console = Console(stderr=True)
    return Terminal(console) if console.is_terminal and not console.is_dumb_terminal else Lines(sys.stderr)
