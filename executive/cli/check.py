"""`executive check`: find mistakes in missions before a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from executive.cli.options import json_option, overrides_option
from executive.cli.streams import print_json, stdout_kept_clean

if TYPE_CHECKING:
    from executive.mission.findings import Finding
    from executive.mission.flow.unhandled_failures import UnhandledFailure


@click.command(name="check")
@click.argument("missions", metavar="MISSION...", nargs=-1, required=True)
@overrides_option
@json_option
@click.pass_context
def command(ctx: click.Context, missions: tuple[str, ...], overrides: dict[str, str], as_json: bool) -> None:
    """Print all mistakes in each MISSION, and the failures that can end its run.

    Exit code 2 if a mission cannot be run.
    """
    with stdout_kept_clean():
        from executive.errors import InputError
        from executive.mission.findings import MAX_LISTED_FINDINGS, Finding
        from executive.mission.load import load_mission
        from executive.plugins import discover, load_cell_kind

        skills = discover()
        reports: list[dict[str, Any]] = []
        texts = []
        for mission in missions:
            try:
                loaded = load_mission(mission, skills, overrides, load_cell_kind)
                findings, endings, ok = loaded.warnings, loaded.unhandled_failures, True
                texts.append(_describe(mission, findings, endings))
            except InputError as error:
                missing = (Finding(mission, 0, 0, "error", "no-mission", str(error)),)
                findings, endings, ok = getattr(error, "findings", missing), (), False
                texts.append(str(error))
            parts = {
                "findings": [
                    {**asdict(finding), "excerpt": finding.shown_excerpt}
                    for finding in findings[:MAX_LISTED_FINDINGS]
                ],
                "endings": [*map(asdict, endings)],
            }
            reports.append({"mission": mission, "ok": ok, **parts})
    if as_json:
        print_json(reports)
    else:
        click.echo("\n".join(texts))
    ctx.exit(0 if all(report["ok"] for report in reports) else 2)


def _describe(mission: str, findings: Sequence[Finding], endings: Sequence[UnhandledFailure]) -> str:
    """Return the warnings of a valid mission, and the failures that can end its run, as text."""
    from executive.mission.findings import describe_findings

    lines = [*describe_findings(findings), f"{mission}: ok"]
    if endings:
        lines.append("  no node handles these failures; each would end the mission:")
        # Endings of a subtree that is used twice have the same place, and count once.
        reasons: dict[tuple[str, str, int], dict[str, None]] = {}
        for ending in endings:
            reasons.setdefault((ending.source, ending.path, ending.line), {})[ending.reason] = None
        names = {place: f"{place[0]}: {', '.join(found)}" for place, found in reasons.items()}
        width = max(map(len, names.values()))
        lines += [f"    {name:{width}}  {path}:{line}" for (_, path, line), name in names.items()]
    return "\n".join(lines)
