"""`executive skills`: describe the installed skills, and check their conformance."""

from __future__ import annotations

import inspect
import json
import re
import textwrap
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, cast, get_args

import click

from executive.cli.options import json_option
from executive.cli.streams import keep_stdout_clean, print_json, print_result
from executive.errors import ExitCode, InputError

if TYPE_CHECKING:
    from executive.skill import Param, Port, Skill

_LINE_WIDTH = 100
"""Maximum length of a line [characters]."""

Declaration = Mapping[str, Any]
"""Declaration of a skill, a port or a param: JSON value of each attribute, by the name of the attribute."""


@click.command(name="skills")
@click.argument("name", required=False)
@click.option("--conform", is_flag=True, help="Check that NAME, or every skill, conforms to the skill rules.")
@json_option
def skills_command(name: str | None, conform: bool, as_json: bool) -> ExitCode:
    """List the installed skills, or describe one skill.

    With NAME, prints all ports, params and failure reasons of this skill. Exit code 1 if a check of --conform
    fails or cannot be run.
    """
    with keep_stdout_clean():
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
    print_result(declarations if name is None else declarations[0], text, as_json=as_json)
    return ExitCode.SUCCESS


def _check_conformance(skills: Mapping[str, type[Skill]], as_json: bool) -> bool:
    """Check skills, print the result of each check, and return True if all checks passed."""
    with keep_stdout_clean():
        # Only this check needs a station, whose import takes half a second.
        from executive.testing.conformance import list_conformance_checks

    verdicts: list[dict[str, Any]] = []
    for name, skill in skills.items():
        for check in list_conformance_checks(skill, name=name):
            with keep_stdout_clean():
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
        print_json(verdicts)
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
