"""`executive skills`: list the installed skills with their ports, params and failure reasons."""

from __future__ import annotations

import inspect
import json
import re
import textwrap
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, cast, get_args

import click

from executive.cli.options import json_option
from executive.cli.streams import print_json, stdout_kept_clean

if TYPE_CHECKING:
    from executive.skill import Param, Port, Skill
    from executive.testing.conformance.check import Verdict

_LINE_WIDTH = 100

Declaration = Mapping[str, Any]
"""Declaration of a skill, a port or a param, as plain JSON values."""


@click.command(name="skills")
@click.argument("name", required=False)
@click.option(
    "--conform", is_flag=True, help="Check that NAME, or every skill, conforms to the contract of skills."
)
@json_option
@click.pass_context
def command(ctx: click.Context, name: str | None, conform: bool, as_json: bool) -> None:
    """List the installed skills, or all declarations of the skill NAME.

    Exit code 1 if a check of --conform fails or cannot be run.
    """
    with stdout_kept_clean():
        from executive.errors import InputError
        from executive.mission.findings import list_choices
        from executive.plugins import discover

        skills = discover()
        if name is not None and name not in skills:
            raise InputError(f'no skill "{name}" is installed. {list_choices(name, skills, "There are")}')
        if name is not None:
            skills = {name: skills[name]}
    if conform:
        ctx.exit(0 if _check_conformance(skills, as_json) else 1)
    known = [collect_declarations(key, skill) for key, skill in skills.items()]
    if as_json:
        print_json(known if name is None else known[0])
    else:
        click.echo("\n".join(map(_summarize, known)) if name is None else _describe(known[0]))


def _check_conformance(skills: Mapping[str, type[Skill]], as_json: bool) -> bool:
    """Check skills, print the results of each skill at once, and return True if all are ok."""
    verdicts: list[Verdict] = []
    for name, skill in skills.items():
        with stdout_kept_clean():
            from executive.testing.conformance import list_conformance_checks
            from executive.view.figures.conformance import format_verdict_counts, format_verdicts

            skill_verdicts = [check.run() for check in list_conformance_checks(skill, name=name)]
        if not as_json:
            click.echo("\n".join(format_verdicts(skill_verdicts)))
        verdicts += skill_verdicts
    if as_json:
        print_json([asdict(verdict) for verdict in verdicts])
    else:
        click.echo(format_verdict_counts(verdicts))
    return all(verdict.status == "ok" for verdict in verdicts)


def collect_declarations(name: str, skill: type[Skill]) -> Declaration:
    """Return the declarations of a skill as plain JSON values."""
    from pydantic_core import to_json

    before, after = skill.tool_state
    facts = {
        "name": name,
        "doc": inspect.getdoc(skill) or "",
        "params": [_declaration_of(param) for param in skill.params.values()],
        "ports": [_declaration_of(port) for port in skill.ports.values()],
        "reasons": skill.reasons,
        "uses": skill.uses,
        "senses": skill.senses,
        "moves": skill.moves,
        "tool": {"before": before, "after": after, "left": skill.tool_left},
    }
    return cast(Declaration, json.loads(to_json(facts, inf_nan_mode="strings", fallback=str)))


def _declaration_of(entry: Param | Port) -> dict[str, Any]:
    """Return the declaration of a param or port by its attributes; the bounds are `min` and `max`."""
    facts = {**vars(entry), "type": _format_type(entry.type), "required": entry.is_required}
    facts["default"] = None if entry.default is ... else entry.default
    return {{"ge": "min", "le": "max"}.get(name, name): value for name, value in facts.items()}


def _format_type(annotation: Any) -> str:
    is_plain = isinstance(annotation, type) and not get_args(annotation)
    name = annotation.__name__ if is_plain else str(annotation)
    return re.sub(r"\b(typing|executive\.cell\.\w+)\.", "", name)


def _summarize(facts: Declaration) -> str:
    """Return two lines about a skill: its purpose, and its ports, params and reasons."""
    reads, writes = (", ".join(port["name"] for port in _ports(facts, way)) for way in ("in", "out"))
    parts = [f"{reads or '-'} -> {writes or '-'}"]
    if facts["params"]:
        parts.append(f"params: {', '.join(param['name'] for param in facts['params'])}")
    if facts["reasons"]:
        parts.append(f"reasons: {', '.join(facts['reasons'])}")
    summary, _, _ = facts["doc"].partition("\n")
    return f"{facts['name']:15} {summary}\n{'':16}{' | '.join(parts)}"


def _describe(facts: Declaration) -> str:
    """Return the complete declaration of a skill as text."""
    lines = [facts["name"], "", facts["doc"], ""]
    for title, entries, nothing in (
        ("reads", _ports(facts, "in"), "nothing"),
        ("writes", _ports(facts, "out"), "nothing"),
        ("params", facts["params"], "none"),
    ):
        lines += [f"{title}:", *(map(_describe_value, entries) if entries else [f"  {nothing}"])]
    lines.append(f"may fail with: {', '.join(facts['reasons']) or 'nothing'}")
    effects = ("; senses" if facts["senses"] else "") + ("; moves the arm" if facts["moves"] else "")
    lines.append(f"uses: {', '.join(facts['uses']) or 'nothing'}{effects}")
    tool = facts["tool"]
    left = "".join(f", {state} after {ending}" for ending, state in tool["left"].items())
    lines.append(f"tool: {tool['before']} before, {tool['after']} after{left}")
    return "\n".join(lines)


def _ports(facts: Declaration, direction: str) -> list[Declaration]:
    return [port for port in facts["ports"] if port["direction"] == direction]


def _describe_value(entry: Declaration) -> str:
    """Return the complete declaration of a param or port as text."""
    words = [entry["type"] + (f" [{entry['unit']}]" if entry.get("unit") else "")]
    if entry["required"] or "direction" not in entry:
        words.append("required" if entry["required"] else f"default {entry['default']!r}")
    elif entry["direction"] == "in":
        words.append("may be left out")
    if entry.get("min") is not None:
        words.append(f"at least {entry['min']:g}")
    if entry.get("max") is not None:
        words.append(f"at most {entry['max']:g}")
    if entry.get("choices"):
        words.append(f"one of {', '.join(map(str, entry['choices']))}")
    if entry["refers"]:
        words.append(f"names {'an' if entry['refers'][0] in 'aeiou' else 'a'} {entry['refers']}")
    text = f"{entry['name']}: {', '.join(words)}" + (f". {entry['doc']}" if entry["doc"] else "")
    return textwrap.fill(
        text, _LINE_WIDTH, initial_indent="  ", subsequent_indent=" " * 6,
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
