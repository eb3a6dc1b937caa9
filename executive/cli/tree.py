"""`executive tree`: print the behaviour tree of a mission."""

from __future__ import annotations

import json
from collections.abc import Sequence
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import click

from executive.cli.options import MISSION, json_option, overrides_option, refuse
from executive.cli.streams import print_json, stdout_kept_clean

if TYPE_CHECKING:
    from executive.cell.protocols import Cell
    from executive.mission.outline import OutlineNode


@click.command(name="tree")
@MISSION
@overrides_option
@click.option(
    "--ports", is_flag=True, help="Print the inputs (? if it may be unset) and outputs of every skill."
)
@click.option(
    "--reasons", is_flag=True,
    help="Print the failure reasons of every skill, and those that every catch handles.",
)  # fmt: skip
@click.option("--fold", is_flag=True, help="Print every subtree once, and afterwards only its name.")
@click.option("--svg", "as_svg", is_flag=True, help="Print the tree as an SVG image on stdout.")
@click.option("--dot", "as_dot", is_flag=True, help="Print the tree as Graphviz text on stdout.")
@json_option
def command(
    mission: str, overrides: dict[str, str], ports: bool, reasons: bool, fold: bool, as_svg: bool,
    as_dot: bool, as_json: bool,
) -> None:  # fmt: skip
    """Print the tree of MISSION with all subtrees expanded."""
    forms = [name for name, wanted in (("--svg", as_svg), ("--dot", as_dot), ("--json", as_json)) if wanted]
    extras = [name for name, wanted in (("--ports", ports), ("--reasons", reasons)) if wanted]
    alone = f"{' and '.join(forms)} exclude each other: standard output holds one of them"
    enough = f"{''.join(forms)} holds ports and reasons anyway; leave out {' and '.join(extras)}"
    refuse((len(forms) > 1, alone), (forms and extras, enough))
    with stdout_kept_clean():
        from pydantic_core import to_json

        from executive.view.tree.dot import draw_dot
        from executive.view.tree.outline import draw_outline, fold_subtrees
        from executive.view.tree.svg import draw_svg

        name, nodes = _outline_of(mission, overrides)
        nodes = fold_subtrees(nodes) if fold else nodes
        if as_svg:
            shown = draw_svg(nodes, name)
        elif as_dot:
            shown = draw_dot(nodes, name)
        elif as_json:
            shown = json.loads(to_json(nodes, inf_nan_mode="strings", fallback=str))
        else:
            shown = draw_outline(nodes, ports=ports, reasons=reasons)
    (print_json if as_json else click.echo)(shown)


def _outline_of(mission: str, overrides: dict[str, str]) -> tuple[str, Sequence[OutlineNode]]:
    """Return a mission's name and its tree's outline."""
    from executive.events import discard_event
    from executive.mission.build import build_tree
    from executive.mission.load import load_mission
    from executive.mission.outline import make_outline
    from executive.plugins import discover
    from executive.tree.blackboard import Blackboard

    skills = discover()
    loaded = load_mission(mission, skills, overrides)
    # A tree that never runs needs no cell, only a clock, which stands still.
    nowhere = cast("Cell", SimpleNamespace(clock=SimpleNamespace(now=0.0)))
    return loaded.mission.name, make_outline(build_tree(loaded, skills, nowhere, Blackboard(), discard_event))
