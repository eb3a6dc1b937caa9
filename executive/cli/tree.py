"""`executive tree`: print the behaviour tree of a mission."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import compress
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import click

from executive.cli.options import check_usage, json_option, mission_argument, overrides_option
from executive.cli.streams import keep_stdout_clean, print_json

if TYPE_CHECKING:
    from executive.cell.protocols import Cell
    from executive.mission.outline import OutlineNode


@click.command(name="tree")
@mission_argument
@overrides_option
@click.option("--ports", is_flag=True, help="Print the inputs (?: possibly unset) and outputs of each skill.")
@click.option(
    "--reasons", is_flag=True,
    help="Print the failure reasons of every skill, and the reasons that every catch handles.",
)  # fmt: skip
@click.option("--fold", is_flag=True, help="Expand each subtree only at its first use.")
@click.option("--svg", "as_svg", is_flag=True, help="Print the tree as an SVG image.")
@click.option("--dot", "as_dot", is_flag=True, help="Print the tree in the DOT language of Graphviz.")
@json_option
def command(
    mission: str, overrides: dict[str, str], ports: bool, reasons: bool, fold: bool, as_svg: bool,
    as_dot: bool, as_json: bool,
) -> None:  # fmt: skip
    """Print the behaviour tree of a mission.

    MISSION is a file or the name of a shipped mission. All subtrees are expanded.
    """
    formats = list(compress(("--svg", "--dot", "--json"), (as_svg, as_dot, as_json)))
    details = list(compress(("--ports", "--reasons"), (ports, reasons)))
    conflict_message = f"{' and '.join(formats)} exclude each other; give one of them"
    redundancy_message = f"{''.join(formats)} always contains ports and reasons; omit {' and '.join(details)}"
    check_usage((len(formats) > 1, conflict_message), (formats and details, redundancy_message))
    with keep_stdout_clean():
        from executive.record.recorded_mission import format_tree
        from executive.view.tree.dot import format_dot
        from executive.view.tree.svg import make_svg
        from executive.view.tree.tree_text import draw_text, fold_subtrees

        name, nodes = _load_outline(mission, overrides)
        nodes = fold_subtrees(nodes) if fold else nodes
        if as_svg:
            output = make_svg(nodes, name)
        elif as_dot:
            output = format_dot(nodes, name)
        elif as_json:
            output = json.loads(format_tree(nodes))
        else:
            output = draw_text(nodes, shows_ports=ports, shows_reasons=reasons)
    print_json(output) if as_json else click.echo(output)


def _load_outline(mission: str, overrides: dict[str, str]) -> tuple[str, Sequence[OutlineNode]]:
    """Return the name of a mission and the nodes of its tree."""
    from executive.events import discard_event
    from executive.mission.build import build_tree
    from executive.mission.load import load_mission
    from executive.mission.outline import make_outline
    from executive.plugins import load_skills
    from executive.tree.blackboard import Blackboard

    skills = load_skills()
    loaded_mission = load_mission(mission, skills, overrides)
    # Building the tree without running it requires only the clock of a cell.
    placeholder_cell = cast("Cell", SimpleNamespace(clock=SimpleNamespace(now=0.0)))
    tree = build_tree(loaded_mission, skills, placeholder_cell, Blackboard(), discard_event)
    return loaded_mission.mission.name, make_outline(tree)
