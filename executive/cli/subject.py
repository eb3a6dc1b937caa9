"""The mission that a campaign runs, as given on a command line."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from executive.campaign.subject import Subject

oracle_option = click.option(
    "--oracle", is_flag=True, help="Detections from the truth: a simulated sort then takes a second or two."
)


def load_subject(mission: str, overrides: dict[str, str], oracle: bool, seed: int) -> Subject:
    """Return the mission that a campaign runs, in the cell it is to be run in.

    Raises:
        MissionError: Something is wrong with the mission.
        InputError: There is no such mission, or its cell is not simulated and an oracle was asked for.
    """
    from executive.campaign.subject import Subject
    from executive.errors import InputError
    from executive.mission.load import load_mission
    from executive.plugins import cell_kind, discover

    skills = discover()
    loaded = load_mission(mission, skills, overrides, cell_kind)
    kind = loaded.cell_config.kind
    if not oracle:
        return Subject(loaded, skills, None, kind, seed)
    if kind != "sim":
        raise InputError(
            f"--oracle is for simulated cells, that of {loaded.mission.name} is of kind {kind}; leave it out"
        )
    from executive.testing.oracle import oracle_cell

    return Subject(loaded, skills, oracle_cell(), "sim, detections from the truth", seed)
