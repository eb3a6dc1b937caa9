"""`executive check`: say everything that is wrong with missions before anything moves."""

from __future__ import annotations

from dataclasses import asdict

import click

from executive.cli.options import json_option
from executive.cli.output import print_json, stdout_kept_clean


@click.command(name="check")
@click.argument("missions", metavar="MISSION...", nargs=-1, required=True)
@json_option
@click.pass_context
def command(ctx: click.Context, missions: tuple[str, ...], as_json: bool) -> None:
    """Load each MISSION and print what is wrong with it; exit code 2 if any cannot be run."""
    with stdout_kept_clean():
        from executive.errors import InputError
        from executive.mission.findings import MissionError
        from executive.mission.load import load_mission
        from executive.skill import discover

        skills = discover()
        reports = []
        for mission in missions:
            findings, text = [], ""
            try:
                load_mission(mission, skills)
            except MissionError as error:
                findings, text = [asdict(finding) for finding in error.findings], str(error)
            except InputError as error:
                findings, text = [{"path": mission, "severity": "error", "message": str(error)}], str(error)
            reports.append({"mission": mission, "ok": not text, "findings": findings})
            if not as_json:
                click.echo(text or f"{mission}: ok", err=True)
    if as_json:
        print_json(reports)
    ctx.exit(0 if all(report["ok"] for report in reports) else 2)
