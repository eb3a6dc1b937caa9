"""`executive check`: say everything that is wrong with missions before anything moves."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import click

from executive.cli.options import json_option, overrides_option
from executive.cli.output import print_json, stdout_kept_clean


@click.command(name="check")
@click.argument("missions", metavar="MISSION...", nargs=-1, required=True)
@overrides_option
@json_option
@click.pass_context
def command(ctx: click.Context, missions: tuple[str, ...], overrides: dict[str, str], as_json: bool) -> None:
    """Print everything that is wrong with each MISSION, and which failures can still end it.

    Exit code 2 if any cannot be run.
    """
    with stdout_kept_clean():
        from executive.discovery import discover
        from executive.errors import InputError
        from executive.mission.findings import Finding, MissionError
        from executive.mission.load import load_mission
        from executive.runtime.cells import cell_kind
        from executive.view.verdict import verdict

        skills = discover()
        reports: list[dict[str, Any]] = []
        texts = []
        for mission in missions:
            report: dict[str, Any] = {"mission": mission, "ok": False, "findings": [], "endings": []}
            try:
                loaded = load_mission(mission, skills, overrides, cell_kind)
                report["findings"] = [asdict(finding) for finding in loaded.warnings]
                report["endings"] = [asdict(ending) for ending in loaded.endings]
                report["ok"] = True
                texts.append(verdict(mission, loaded.warnings, loaded.endings))
            except MissionError as error:
                report["findings"] = [asdict(finding) for finding in error.findings]
                texts.append(str(error))
            except InputError as error:
                finding = Finding(mission, 0, 0, "error", "no-mission", str(error))
                report["findings"] = [asdict(finding)]
                texts.append(str(error))
            reports.append(report)
    if as_json:
        print_json(reports)
    else:
        click.echo("\n".join(texts))
    ctx.exit(0 if all(report["ok"] for report in reports) else 2)
