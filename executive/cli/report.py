"""`executive report`: write the report of a recorded run."""

from __future__ import annotations

from pathlib import Path

import click

from executive.cli.options import json_option, runs_option
from executive.cli.streams import keep_stdout_clean, print_json


@click.command(name="report")
@click.argument("run", metavar="RUN")
@runs_option
@json_option
def command(run: str, runs_folder: Path, as_json: bool) -> None:
    """Write the report of a recorded run.

    RUN is a run directory or `latest`. Prints the path of the report. Every run writes its report when it
    ends; this command writes the report again, or for the first time if the run was killed.
    """
    with keep_stdout_clean():
        from executive.record.run_directory import find_run
        from executive.view.report import write_report

        file = write_report(find_run(run, runs_folder))
    if as_json:
        print_json({"report": str(file), "bytes": file.stat().st_size})
    else:
        click.echo(file)
