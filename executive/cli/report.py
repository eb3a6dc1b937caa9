"""`executive report`: write the page that explains a recorded run."""

from __future__ import annotations

from pathlib import Path

import click

from executive.cli.options import json_option, runs_option
from executive.cli.streams import print_json, stdout_kept_clean


@click.command(name="report")
@click.argument("run", metavar="RUN")
@runs_option
@json_option
def command(run: str, runs: Path, as_json: bool) -> None:
    """Write the report of RUN (a run directory, or `latest`) again, and print its path.

    Every run writes a report at its end; a killed run has none yet.
    """
    with stdout_kept_clean():
        from executive.record.run_directory import find_run
        from executive.view.report.page import write_report

        file = write_report(find_run(run, runs))
    if as_json:
        print_json({"report": str(file), "bytes": file.stat().st_size})
    else:
        click.echo(file)
