"""Commands that read a mission without running it: `check`, `tree` and `schema`."""

from __future__ import annotations

import atexit
import gc
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from itertools import compress
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import click

from executive.cli.options import cell_option, check_usage, json_option, mission_argument, overrides_option
from executive.cli.streams import keep_stdout_clean, print_json, print_result
from executive.errors import ExitCode, InputError

if TYPE_CHECKING:
    from executive.mission.analysis import UnhandledFailure


@click.command(name="check")
@click.argument("missions", metavar="MISSION...", nargs=-1, required=True)
@overrides_option
@cell_option
@json_option
def check_command(missions: tuple[str, ...], overrides: dict[str, str], cell: str, as_json: bool) -> ExitCode:
    """Check missions without running them.

    Prints the errors and warnings of each MISSION (a file or the name of a shipped mission), and the failures
    that can end its run. Exit code 2 if a mission has errors.
    """
    with keep_stdout_clean():
        # The imports take 0.3 s, for which `--help` must not wait.
        from executive.behaviours import load_skills
        from executive.mission.load import load_mission
        from executive.station.check import load_checker
        from executive.text.findings import MAX_LISTED_FINDINGS, Finding, MissionError, describe_findings
        from executive.text.yaml_files import find_cell

        # The last garbage collection of the process would take 0.1 s. Commands that plan motions need this
        # collection, because ruckig would otherwise report its objects as leaks.
        atexit.register(gc.freeze)
        if cell:
            find_cell(cell)  # A missing cell is no mistake of a mission.
        skills = load_skills()
        reports: list[dict[str, Any]] = []
        texts = []
        for mission in missions:
            failures: Sequence[UnhandledFailure] = ()
            is_valid = False
            try:
                loaded = load_mission(mission, skills, overrides, load_checker, cell)
                findings = loaded.warnings
                failures = loaded.unhandled_failures
                is_valid = True
                lines = [*describe_findings(findings), f"{mission}: ok", *_list_failure_lines(failures)]
                texts.append("\n".join(lines))
            except InputError as error:
                missing_mission = Finding(mission, 0, 0, "error", "no-mission", str(error))
                findings = error.findings if isinstance(error, MissionError) else (missing_mission,)
                texts.append(str(error))
            listed_findings = findings[:MAX_LISTED_FINDINGS]
            entries = [{**asdict(finding), "excerpt": finding.shown_excerpt} for finding in listed_findings]
            endings = list(map(asdict, failures))
            reports.append({"mission": mission, "ok": is_valid, "findings": entries, "endings": endings})
    print_result(reports, "\n".join(texts), as_json=as_json)
    return ExitCode.SUCCESS if all(report["ok"] for report in reports) else ExitCode.INVALID_INPUT


def _list_failure_lines(failures: Sequence[UnhandledFailure]) -> Iterator[str]:
    """Yield the lines about the failures that can end the run of a valid mission."""
    if not failures:
        return
    yield "  no node handles these failures; each would end the mission:"
    # If a mission uses a subtree twice, the failures of the subtree are listed once.
    reasons_by_place: dict[tuple[str, str, int], dict[str, None]] = {}
    for failure in failures:
        place = (failure.source, failure.path, failure.line)
        reasons_by_place.setdefault(place, {})[failure.reason] = None
    descriptions = {place: f"{place[0]}: {', '.join(names)}" for place, names in reasons_by_place.items()}
    width = max(map(len, descriptions.values()))
    yield from (f"    {text:{width}}  {path}:{line}" for (_, path, line), text in descriptions.items())


@click.command(name="tree")
@mission_argument
@overrides_option
@cell_option
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
def tree_command(
    mission: str, overrides: dict[str, str], cell: str, ports: bool, reasons: bool, fold: bool, as_svg: bool,
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
        # The imports take half a second, for which `--help` and wrong options must not wait.
        from executive.behaviours import load_skills
        from executive.events import discard_event
        from executive.mission.load import build_tree, load_mission
        from executive.mission.outline import make_outline
        from executive.record.run_directory import format_tree
        from executive.tree.blackboard import Blackboard
        from executive.view.btcpp import format_btcpp
        from executive.view.svg import make_svg
        from executive.view.text import draw_text, fold_subtrees

        loaded = load_mission(mission, load_skills(), overrides, replacing_cell=cell)
        # No node of the tree is executed, so that none needs a clock or a ledger.
        placeholder_cell: Any = SimpleNamespace(clock=None, ledger=None)
        nodes = make_outline(build_tree(loaded, loaded.skills, placeholder_cell, Blackboard(), discard_event))
        nodes = fold_subtrees(nodes) if fold else nodes
        match "".join(formats).removeprefix("--format ").removeprefix("--"):
            case "svg":
                output = make_svg(nodes, loaded.mission.name)
            case "json":
                output = json.loads(format_tree(nodes))
                as_json = True
            case "btcpp":
                output = format_btcpp(loaded.mission, loaded.skills)
            case _:
                output = draw_text(nodes, shows_ports=ports, shows_reasons=reasons)
    print_result(output, output, as_json=as_json)


@click.command(name="schema")
@click.option("--cell", is_flag=True, help="Print the schema of cell files instead.")
@click.option("--arm", is_flag=True, help="Print the schema of arm files instead.")
@click.option("--library", is_flag=True, help="Print the schema of library files instead.")
@click.option("--journal", is_flag=True, help="Print the schema of the lines of a journal instead.")
def schema_command(cell: bool, arm: bool, library: bool, journal: bool) -> None:
    """Print the JSON Schema of mission files.

    The schema includes the installed skills. Save it as mission.schema.json beside the missions: an editor
    with the YAML language server uses it in files that begin with
    `# yaml-language-server: $schema=mission.schema.json`.
    """
    if cell + arm + library + journal > 1:
        raise click.UsageError("--cell, --arm, --library and --journal exclude each other; give one of them")
    with keep_stdout_clean():
        # The imports take half a second, for which `--help` and wrong options must not wait.
        from executive.behaviours import load_skills
        from executive.mission import schema
        from executive.record.journal import make_journal_schema
        from executive.tree.node import load_control_nodes

        if cell:
            content = schema.make_cell_schema()
        elif arm:
            content = schema.make_arm_schema()
        elif journal:
            content = make_journal_schema()
        else:
            make_schema = schema.make_library_schema if library else schema.make_mission_schema
            content = make_schema(load_skills(), load_control_nodes())
    print_json(content)
