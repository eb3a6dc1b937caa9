"""`executive tree`: print the behaviour tree of a mission."""

from __future__ import annotations

import json
from itertools import compress
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import click

from executive.cli.options import check_usage, json_option, mission_argument, overrides_option
from executive.cli.streams import keep_stdout_clean, print_json

if TYPE_CHECKING:
    from executive.cell.protocols import Cell


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
@click.option(
    "--format", "format_name", type=click.Choice(("svg", "json", "btcpp")),
    help="The same as --svg or --json; btcpp: XML for BehaviorTree.CPP 4 and its editor Groot2.",
)  # fmt: skip
@json_option
def command(
    mission: str, overrides: dict[str, str], ports: bool, reasons: bool, fold: bool, as_svg: bool,
    format_name: str | None, as_json: bool,
) -> None:  # fmt: skip
    """Print the behaviour tree of a mission.

    MISSION is a file or the name of a shipped mission. All subtrees are expanded, except in the format btcpp,
    in which each subtree is a tree of its own.
    """
    flags = {"--svg": as_svg, "--json": as_json, f"--format {format_name}": format_name}
    formats = [flag for flag, is_given in flags.items() if is_given]
    details = list(compress(("--ports", "--reasons"), (ports, reasons)))
    conflict_message = f"{' and '.join(formats)} exclude each other; give one of them"
    redundancy_message = f"{''.join(formats)} always contains ports and reasons; omit {' and '.join(details)}"
    check_usage((len(formats) > 1, conflict_message), (formats and details, redundancy_message))
    with keep_stdout_clean():
        from executive.events import discard_event
        from executive.mission.build import build_tree
        from executive.mission.load import load_mission
        from executive.mission.outline import make_outline
        from executive.plugins import load_skills
        from executive.record.run_directory import format_tree
        from executive.tree.tree_node import Blackboard
        from executive.view.btcpp import format_btcpp
        from executive.view.svg import make_svg
        from executive.view.text import draw_text, fold_subtrees

        loaded = load_mission(mission, load_skills(), overrides)
        # No node of the tree is executed, so that none needs a clock or a ledger.
        placeholder_cell = cast("Cell", SimpleNamespace(clock=None, ledger=None))
        nodes = make_outline(build_tree(loaded, loaded.skills, placeholder_cell, Blackboard(), discard_event))
        nodes = fold_subtrees(nodes) if fold else nodes
        match "".join(formats).removeprefix("--format ").removeprefix("--"):
            case "svg":
                output = make_svg(nodes, loaded.mission.name)
            case "json":
                output, as_json = json.loads(format_tree(nodes)), True
            case "btcpp":
                output = format_btcpp(loaded.mission, loaded.skills)
            case _:
                output = draw_text(nodes, shows_ports=ports, shows_reasons=reasons)
    print_json(output) if as_json else click.echo(output)
