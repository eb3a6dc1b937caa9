"""`executive skills`: what the installed skills do, need and may fail with."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Any

import click

from executive.cli.output import stdout_kept_clean

if TYPE_CHECKING:
    from executive.skill import Param, Port, Skill


@click.command(name="skills")
@click.argument("name", required=False)
def command(name: str | None) -> None:
    """List the installed skills, or tell everything about the skill NAME."""
    with stdout_kept_clean():
        from executive.errors import InputError
        from executive.mission.findings import alternatives
        from executive.skill import discover

        skills = discover()
        if name is not None and name not in skills:
            raise InputError(f'no skill "{name}" is installed. {alternatives(name, skills, "There are")}')
    if name is not None:
        click.echo(describe(name, skills[name]))
        return
    for known, skill in skills.items():
        click.echo(f"{known:16}{(inspect.getdoc(skill) or '').splitlines()[0]}")
        click.echo(f"{'':16}{_flow(skill)}")


def describe(name: str, skill: type[Skill]) -> str:
    """Return everything a mission's author needs to know about `skill`."""
    from executive.skill import Direction

    lines = [name, "", inspect.getdoc(skill) or "", ""]
    for title, direction in (("reads", Direction.IN), ("writes", Direction.OUT)):
        lines += [f"{title}:"]
        lines += [
            f"  {port.name}: {_type(port)}" for port in skill.ports.values() if port.direction is direction
        ] or ["  nothing"]
    lines += ["params:"]
    lines += [f"  {_param(param)}" for param in skill.params.values()] or ["  none"]
    lines += [f"may fail with: {', '.join(skill.reasons) or 'nothing'}"]
    lines += [f"uses: {', '.join(skill.uses) or 'nothing'}"]
    before, after = skill.tool_state
    lines += [f"tool: {before.value} before, {after.value} after"]
    return "\n".join(lines)


def _flow(skill: type[Skill]) -> str:
    from executive.skill import Direction

    reads = [port.name for port in skill.ports.values() if port.direction is Direction.IN]
    writes = [port.name for port in skill.ports.values() if port.direction is Direction.OUT]
    parts = [f"{', '.join(reads) or '-'} -> {', '.join(writes) or '-'}"]
    if skill.params:
        parts.append(f"params: {', '.join(skill.params)}")
    if skill.reasons:
        parts.append(f"reasons: {', '.join(skill.reasons)}")
    return " | ".join(parts)


def _param(param: Param) -> str:
    facts = [_type(param) + (f" [{param.unit}]" if param.unit else "")]
    facts.append("required" if param.required else f"default {param.default!r}")
    if param.ge is not None:
        facts.append(f"at least {param.ge:g}")
    if param.le is not None:
        facts.append(f"at most {param.le:g}")
    if param.choices is not None:
        facts.append(f"one of {', '.join(map(str, param.choices))}")
    if param.refers:
        facts.append(f"names a {param.refers}")
    return f"{param.name}: {', '.join(facts)}" + (f". {param.doc}" if param.doc else "")


def _type(declared: Port | Param) -> str:
    kind: Any = declared.type
    name = kind.__name__ if isinstance(kind, type) and not hasattr(kind, "__args__") else str(kind)
    return name.replace("typing.", "").replace("executive.messages.", "")
