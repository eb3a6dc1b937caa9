"""`executive tree`: show the behaviour tree that a mission becomes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import click

from executive.cli.options import MISSION, overrides_option
from executive.cli.output import stdout_kept_clean

if TYPE_CHECKING:
    from executive.cell import Cell


@click.command(name="tree")
@MISSION
@overrides_option
def command(mission: str, overrides: dict[str, str]) -> None:
    """Print the tree of MISSION, subtrees in their places."""
    with stdout_kept_clean():
        from executive.control.scope import Scope
        from executive.events import ignore
        from executive.mission.build import build
        from executive.mission.load import load_mission
        from executive.mission.outline import outline
        from executive.skill import discover
        from executive.view.outline import drawn

        skills = discover()
        loaded = load_mission(mission, skills, overrides)
        # A tree that never runs needs no cell, only somewhere to take the clock from.
        nowhere = cast("Cell", SimpleNamespace(clock=None))
        text = drawn(outline(build(loaded, skills, nowhere, Scope(), ignore)))
    click.echo(text)
