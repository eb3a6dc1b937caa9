"""Commands that run no mission: `check`, `tree` and `schema` of missions, and `skills`."""

from __future__ import annotations

import atexit
import gc
import inspect
import json
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from itertools import compress
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast, get_args

import click

from executive.cli import shared
from executive.errors import ExitCode, InputError

if TYPE_CHECKING:
    from executive.mission.analysis import UnhandledFailure
    from executive.skill import Param, Port, Skill

_LINE_WIDTH = 100
"""Maximum length of a line about a skill [characters]."""

Declaration = Mapping[str, Any]
"""Declaration of a skill, a port or a param: JSON value of each attribute, by the name of the attribute."""


@click.command(name="check")
@click.argument("missions", metavar="MISSION...", nargs=-1, required=True)
@shared.overrides_option
@shared.cell_option
@shared.json_option
def check_command(missions: tuple[str, ...], overrides: dict[str, str], cell: str, as_json: bool) -> ExitCode:
    """Check missions without running them.

    Prints the errors and warnings of each MISSION (a file or the name of a shipped mission), and the failures
    that can end its run. Exit code 2 if a mission has errors.
    """
    with shared.keep_stdout_clean():
        # The imports take 0.3 s, for which `--help` must not wait.
        from executive.behaviours import load_skills
        from executive.mission.load import load_mission
        from executive.station.check import load_checker
        from executive.text.files import find_cell
        from executive.text.findings import MAX_LISTED_FINDINGS, Finding, MissionError, describe_findings

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
    shared.print_result(reports, "\n".join(texts), as_json=as_json)
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
@shared.mission_argument
@shared.overrides_option
@shared.cell_option
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
@shared.json_option
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
    shared.check_usage((len(formats) > 1, conflict_message), (formats and details, redundancy_message))
    with shared.keep_stdout_clean():
        # The imports take half a second, for which `--help` and wrong options must not wait.
        from executive.behaviours import load_skills
        from executive.events import discard_event
        from executive.mission.load import build_tree, load_mission
        from executive.mission.outline import make_outline
        from executive.record.run_directory import format_tree
        from executive.tree.blackboard import Blackboard
        from executive.view.btcpp import format_btcpp
        from executive.view.drawing import draw_text, fold_subtrees, make_svg

        loaded = load_mission(mission, load_skills(), overrides, replacing_cell=cell)
        # No node of the tree is executed, so that none needs a clock or a ledger.
        placeholder_cell: Any = SimpleNamespace(clock=None, ledger=None)
        nodes = make_outline(build_tree(loaded, placeholder_cell, Blackboard(), discard_event))
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
    shared.print_result(output, output, as_json=as_json)


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
    with shared.keep_stdout_clean():
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
    shared.print_json(content)


@click.command(name="skills")
@click.argument("name", required=False)
@click.option("--conform", is_flag=True, help="Check that NAME, or every skill, conforms to the skill rules.")
@shared.json_option
def skills_command(name: str | None, conform: bool, as_json: bool) -> ExitCode:
    """List the installed skills, or describe one skill.

    With NAME, prints all ports, params and failure reasons of this skill. Exit code 1 if a check of --conform
    fails or cannot be run.
    """
    with shared.keep_stdout_clean():
        # The imports take 0.2 s, for which `--help` must not wait.
        from executive.behaviours import load_skills
        from executive.text.findings import suggest_choice

        skills = load_skills()
        if name is not None and name not in skills:
            raise InputError(f'there is no skill "{name}". {suggest_choice(name, skills, "There are")}')
        if name is not None:
            skills = {name: skills[name]}
    if conform:
        return ExitCode.SUCCESS if _check_conformance(skills, as_json) else ExitCode.FAILURE
    declarations = [collect_declarations(key, skill) for key, skill in skills.items()]
    text = "\n".join(map(_describe_skill if name else _summarize_skill, declarations))
    shared.print_result(declarations if name is None else declarations[0], text, as_json=as_json)
    return ExitCode.SUCCESS


def _check_conformance(skills: Mapping[str, type[Skill]], as_json: bool) -> bool:
    """Check skills, print the result of each check, and return True if all checks passed."""
    with shared.keep_stdout_clean():
        # Only this check needs a station, whose import takes half a second.
        from executive.testing.conformance import list_conformance_checks

    verdicts: list[dict[str, Any]] = []
    for name, skill in skills.items():
        for check in list_conformance_checks(skill, name=name):
            with shared.keep_stdout_clean():
                problems = check.find_problems()
            status = "failed" if problems else "ok"
            rule = check.rule.__name__
            summary = (check.rule.__doc__ or "").partition("\n")[0]
            verdicts.append(
                {"skill": name, "check": rule, "doc": summary, "status": status, "problems": problems}
            )
            if not as_json:
                click.echo(": ".join([f"{status:7}  {name}.{rule}", *problems[:1]]))
    failed_count = sum(verdict["status"] != "ok" for verdict in verdicts)
    if as_json:
        shared.print_json(verdicts)
    else:
        skills_text = f"{len(skills)} skill{'' if len(skills) == 1 else 's'}"
        counts = f"{len(verdicts) - failed_count} ok" + (f", {failed_count} failed" if failed_count else "")
        click.echo(f"{len(verdicts)} checks of {skills_text}: {counts}")
    return not failed_count


def collect_declarations(name: str, skill: type[Skill]) -> Declaration:
    """Return a skill's declaration as JSON values; `tool.left` is the tool state after each failure."""
    # The skills have imported pydantic, for which `--help` must not wait.
    from pydantic_core import to_json

    state_before, state_after = skill.tool_state
    values = {
        "name": name,
        "doc": inspect.getdoc(skill) or "",
        "params": [_declare_entry(param) for param in skill.params.values()],
        "ports": [_declare_entry(port) for port in skill.ports.values()],
        "reasons": skill.reasons,
        "uses": skill.uses,
        "senses": skill.senses,
        "moves": skill.moves,
        "is_condition": skill.is_condition,
        "tool": {"before": state_before, "after": state_after, "left": skill.tool_state_after_failure},
    }
    return cast(Declaration, json.loads(to_json(values, inf_nan_mode="strings", fallback=str)))


def _declare_entry(entry: Param | Port) -> dict[str, Any]:
    """Return a declaration as JSON values; `ge`, `le` and `refers_to` become `min`, `max` and `refers`."""
    values = {**vars(entry), "type": _format_type(entry.type), "required": entry.is_required}
    values["default"] = None if entry.default is ... else entry.default
    keys = {"ge": "min", "le": "max", "refers_to": "refers"}
    return {keys.get(name, name): value for name, value in values.items()}


def _format_type(annotation: Any) -> str:
    """Return the name of a type without the module names `typing` and `executive.cell.*`."""
    is_class = isinstance(annotation, type) and not get_args(annotation)
    name = annotation.__name__ if is_class else str(annotation)
    return re.sub(r"\b(typing|executive\.cell\.\w+)\.", "", name)


def _summarize_skill(skill: Declaration) -> str:
    """Return two lines about a skill: its purpose, and its ports, params and reasons."""
    inputs = ", ".join(port["name"] for port in _list_ports(skill, "in"))
    outputs = ", ".join(port["name"] for port in _list_ports(skill, "out"))
    parts = [f"{inputs or '-'} -> {outputs or '-'}"]
    if skill["params"]:
        parts.append(f"params: {', '.join(param['name'] for param in skill['params'])}")
    if skill["reasons"]:
        parts.append(f"reasons: {', '.join(skill['reasons'])}")
    summary, _, _ = skill["doc"].partition("\n")
    return f"{skill['name']:15} {summary}\n{'':16}{' | '.join(parts)}"


def _describe_skill(skill: Declaration) -> str:
    """Return the complete declaration of a skill as text."""
    lines = [skill["name"], "", skill["doc"], ""]
    for title, entries, empty_text in (
        ("reads", _list_ports(skill, "in"), "nothing"),
        ("writes", _list_ports(skill, "out"), "nothing"),
        ("params", skill["params"], "none"),
    ):
        lines += [f"{title}:", *(map(_describe_entry, entries) if entries else [f"  {empty_text}"])]
    lines.append(f"may fail with: {', '.join(skill['reasons']) or 'nothing'}")
    effects_text = ("; senses" if skill["senses"] else "") + ("; moves the arm" if skill["moves"] else "")
    lines.append(f"uses: {', '.join(skill['uses']) or 'nothing'}{effects_text}")
    if skill["is_condition"]:
        lines.append("condition: decides in one tick and changes nothing")
    tool = skill["tool"]
    exceptions_text = "".join(f", {state} after {ending}" for ending, state in tool["left"].items())
    lines.append(f"tool: {tool['before']} before, {tool['after']} after{exceptions_text}")
    return "\n".join(lines)


def _list_ports(skill: Declaration, direction: str) -> list[Declaration]:
    """Return the input ports (`in`) or the output ports (`out`) of a skill."""
    return [port for port in skill["ports"] if port["direction"] == direction]


def _describe_entry(entry: Declaration) -> str:
    """Return the complete declaration of a param or port as text."""
    parts = [entry["type"] + (f" [{entry['unit']}]" if entry.get("unit") else "")]
    if entry["required"] or "direction" not in entry:
        parts.append("required" if entry["required"] else f"default {entry['default']!r}")
    elif entry["direction"] == "in":
        parts.append("optional")
    if entry.get("min") is not None:
        parts.append(f"at least {entry['min']:g}")
    if entry.get("max") is not None:
        parts.append(f"at most {entry['max']:g}")
    if entry.get("choices"):
        parts.append(f"one of {', '.join(map(str, entry['choices']))}")
    if entry["refers"]:
        parts.append(f"names {'an' if entry['refers'][0] in 'aeiou' else 'a'} {entry['refers']}")
    text = f"{entry['name']}: {', '.join(parts)}" + (f". {entry['doc']}" if entry["doc"] else "")
    return textwrap.fill(
        text, _LINE_WIDTH, initial_indent="  ", subsequent_indent=" " * 6,
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
