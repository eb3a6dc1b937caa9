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
        from executive.runtime.cells import robot_check
        from executive.skill import discover

        skills = discover()
        reports, texts = [], []
        for mission in missions:
            ok = False
            try:
                found = load_mission(mission, skills, robot_check=robot_check).warnings
                findings, text = [asdict(finding) for finding in found], "\n".join(map(str, found))
                ok = True
            except MissionError as error:
                findings, text = [asdict(finding) for finding in error.findings], str(error)
            except InputError as error:
                findings, text = [{"path": mission, "severity": "error", "message": str(error)}], str(error)
            reports.append({"mission": mission, "ok": ok, "findings": findings})
            texts.append(text or f"{mission}: ok")
    if as_json:
        print_json(reports)
    else:
        click.echo("\n".join(texts))
    ctx.exit(0 if all(report["ok"] for report in reports) else 2)
