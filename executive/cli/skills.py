"""`executive skills`: what the installed skills do, need and may fail with."""

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

_WIDTH = 100

Facts = Mapping[str, Any]
"""What a skill, a port or a param declares, as plain JSON values."""


@click.command(name="skills")
@click.argument("name", required=False)
@click.option("--conform", is_flag=True, help="Check that NAME, or every skill, does what any skill must.")
@json_option
@click.pass_context
def command(ctx: click.Context, name: str | None, conform: bool, as_json: bool) -> None:
    """List the installed skills, or all declarations of the skill NAME.

    With --conform the exit code is 1 if a check fails, or cannot be run.
    """
    with stdout_kept_clean():
        from executive.errors import InputError
        from executive.mission.findings import alternatives
        from executive.plugins import discover

        skills = discover()
        if name is not None and name not in skills:
            raise InputError(f'no skill "{name}" is installed. {alternatives(name, skills, "There are")}')
        if name is not None:
            skills = {name: skills[name]}
    if conform:
        ctx.exit(0 if _conform(skills, as_json) else 1)
    known = [declared(key, skill) for key, skill in skills.items()]
    if as_json:
        print_json(known if name is None else known[0])
    else:
        click.echo("\n".join(map(_briefly, known)) if name is None else _fully(known[0]))


def _conform(skills: Mapping[str, type[Skill]], as_json: bool) -> bool:
    """Check skills, print the results of each skill at once, and return True if all are ok."""
    verdicts: list[Verdict] = []
    for name, skill in skills.items():
        with stdout_kept_clean():
            from executive.testing.conformance import conformance
            from executive.view.figures.conformance import conformance_lines, conformance_total

            found = [check.run() for check in conformance(skill, name=name)]
        if not as_json:
            click.echo("\n".join(conformance_lines(found)))
        verdicts += found
    print_json([asdict(one) for one in verdicts]) if as_json else click.echo(conformance_total(verdicts))
    return all(verdict.status == "ok" for verdict in verdicts)


def declared(name: str, skill: type[Skill]) -> Facts:
    """Return the declarations of a skill as plain JSON values."""
    from pydantic_core import to_json

    before, after = skill.tool_state
    facts = {
        "name": name,
        "doc": inspect.getdoc(skill) or "",
        "params": [_declared(param) for param in skill.params.values()],
        "ports": [_declared(port) for port in skill.ports.values()],
        "reasons": skill.reasons,
        "uses": skill.uses,
        "senses": skill.senses,
        "moves": skill.moves,
        "tool": {"before": before, "after": after, "left": skill.tool_left},
    }
    return cast(Facts, json.loads(to_json(facts, inf_nan_mode="strings", fallback=str)))


def _declared(declared: Param | Port) -> dict[str, Any]:
    """Return the declaration of a param or port by its attributes; the bounds are `min` and `max`."""
    facts = {**vars(declared), "type": _type(declared.type), "required": declared.required}
    facts["default"] = None if declared.default is ... else declared.default
    return {{"ge": "min", "le": "max"}.get(name, name): value for name, value in facts.items()}


def _type(declared: Any) -> str:
    plain = isinstance(declared, type) and not get_args(declared)
    name = declared.__name__ if plain else str(declared)
    return re.sub(r"\b(typing|executive\.cell\.\w+)\.", "", name)


def _briefly(facts: Facts) -> str:
    """Return a skill in two lines: what it does, and what flows through it."""
    reads, writes = (", ".join(port["name"] for port in _ports(facts, way)) for way in ("in", "out"))
    parts = [f"{reads or '-'} -> {writes or '-'}"]
    if facts["params"]:
        parts.append(f"params: {', '.join(param['name'] for param in facts['params'])}")
    if facts["reasons"]:
        parts.append(f"reasons: {', '.join(facts['reasons'])}")
    summary, _, _ = facts["doc"].partition("\n")
    return f"{facts['name']:15} {summary}\n{'':16}{' | '.join(parts)}"


def _fully(facts: Facts) -> str:
    """Return all declarations of a skill for authors of missions."""
    lines = [facts["name"], "", facts["doc"], ""]
    for title, entries, nothing in (
        ("reads", _ports(facts, "in"), "nothing"),
        ("writes", _ports(facts, "out"), "nothing"),
        ("params", facts["params"], "none"),
    ):
        lines += [f"{title}:", *(map(_entry, entries) if entries else [f"  {nothing}"])]
    lines.append(f"may fail with: {', '.join(facts['reasons']) or 'nothing'}")
    effects = ("; senses" if facts["senses"] else "") + ("; moves the arm" if facts["moves"] else "")
    lines.append(f"uses: {', '.join(facts['uses']) or 'nothing'}{effects}")
    tool = facts["tool"]
    left = "".join(f", {state} after {ending}" for ending, state in tool["left"].items())
    lines.append(f"tool: {tool['before']} before, {tool['after']} after{left}")
    return "\n".join(lines)


def _ports(facts: Facts, direction: str) -> list[Facts]:
    return [port for port in facts["ports"] if port["direction"] == direction]


def _entry(of: Facts) -> str:
    """Return a param or port with everything about it."""
    words = [of["type"] + (f" [{of['unit']}]" if of.get("unit") else "")]
    if of["required"] or "direction" not in of:
        words.append("required" if of["required"] else f"default {of['default']!r}")
    elif of["direction"] == "in":
        words.append("may be left out")
    if of.get("min") is not None:
        words.append(f"at least {of['min']:g}")
    if of.get("max") is not None:
        words.append(f"at most {of['max']:g}")
    if of.get("choices"):
        words.append(f"one of {', '.join(map(str, of['choices']))}")
    if of["refers"]:
        words.append(f"names {'an' if of['refers'][0] in 'aeiou' else 'a'} {of['refers']}")
    text = f"{of['name']}: {', '.join(words)}" + (f". {of['doc']}" if of["doc"] else "")
    return textwrap.fill(
        text, _WIDTH, initial_indent="  ", subsequent_indent=" " * 6,
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
