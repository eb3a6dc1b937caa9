"""`executive check`: find errors in missions before a run."""

from __future__ import annotations

import atexit
import gc
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from executive.cli.options import json_option, overrides_option
from executive.cli.streams import keep_stdout_clean, print_json
from executive.errors import ExitCode

if TYPE_CHECKING:
    from executive.mission.analysis import UnhandledFailure
    from executive.mission.findings import Finding


@click.command(name="check")
@click.argument("missions", metavar="MISSION...", nargs=-1, required=True)
@overrides_option
@json_option
def command(missions: tuple[str, ...], overrides: dict[str, str], as_json: bool) -> ExitCode:
    """Check missions without running them.

    Prints the errors and warnings of each MISSION (a file or the name of a shipped mission), and the failures
    that can end its run. Exit code 2 if a mission has errors.
    """
    with keep_stdout_clean():
        from executive.errors import InputError
        from executive.mission.findings import MAX_LISTED_FINDINGS, Finding, MissionError
        from executive.mission.load import load_mission
        from executive.plugins import load_cell_kind, load_skills

        # The last garbage collection of the process would take 0.1 s. Commands that plan motions need this
        # collection, because ruckig would otherwise report its objects as leaks.
        atexit.register(gc.freeze)
        skills = load_skills()
        reports: list[dict[str, Any]] = []
        texts = []
        for mission in missions:
            try:
                loaded = load_mission(mission, skills, overrides, load_cell_kind)
                findings, failures, is_valid = loaded.warnings, loaded.unhandled_failures, True
                texts.append(_describe_mission(mission, findings, failures))
            except InputError as error:
                missing_mission = Finding(mission, 0, 0, "error", "no-mission", str(error))
                findings = error.findings if isinstance(error, MissionError) else (missing_mission,)
                failures, is_valid = (), False
                texts.append(str(error))
            listed_findings = findings[:MAX_LISTED_FINDINGS]
            entries = [{**asdict(finding), "excerpt": finding.shown_excerpt} for finding in listed_findings]
            endings = [*map(asdict, failures)]
            reports.append({"mission": mission, "ok": is_valid, "findings": entries, "endings": endings})
    if as_json:
        print_json(reports)
    else:
        click.echo("\n".join(texts))
    return ExitCode.SUCCESS if all(report["ok"] for report in reports) else ExitCode.INVALID_INPUT


def _describe_mission(mission: str, warnings: Sequence[Finding], failures: Sequence[UnhandledFailure]) -> str:
    """Return a text with the warnings of a valid mission, and with the failures that can end its run."""
    from executive.mission.findings import describe_findings

    lines = [*describe_findings(warnings), f"{mission}: ok"]
    if failures:
        lines.append("  no node handles these failures; each would end the mission:")
        # If a mission uses a subtree twice, the failures of the subtree are listed once.
        reasons_by_place: dict[tuple[str, str, int], dict[str, None]] = {}
        for failure in failures:
            place = (failure.source, failure.path, failure.line)
            reasons_by_place.setdefault(place, {})[failure.reason] = None
        descriptions = {place: f"{place[0]}: {', '.join(names)}" for place, names in reasons_by_place.items()}
        width = max(map(len, descriptions.values()))
        lines += [f"    {text:{width}}  {path}:{line}" for (_, path, line), text in descriptions.items()]
    return "\n".join(lines)
