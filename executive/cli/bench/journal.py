"""`executive bench journal`: what the journal costs."""

from __future__ import annotations

from pathlib import Path

import click

from executive.cli.options import MISSION, json_option, overrides_option, runs_option, seed_option
from executive.cli.output import print_json, stdout_kept_clean


@click.command(name="journal")
@MISSION
@seed_option
@overrides_option
@runs_option
@json_option
def journal(mission: str, seed: int, overrides: dict[str, str], runs: Path, as_json: bool) -> None:
    """Measure what the journal costs a run of MISSION; its record is thrown away."""
    with stdout_kept_clean():
        from executive.campaign.journal_cost import measure
        from executive.discovery import discover
        from executive.mission.load import load_mission
        from executive.runtime.cells import cell_kind

        skills = discover()
        loaded = load_mission(mission, skills, overrides, cell_kind)
        cost = measure(loaded, skills, seed=seed, runs=runs)
    if as_json:
        print_json(cost.as_plain())
    else:
        click.echo(cost.text())
