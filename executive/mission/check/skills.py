"""Checks of single skills and their settings."""

from __future__ import annotations

from collections.abc import Iterator

from executive.mission.check.case import Case
from executive.mission.findings import Finding, alternatives, error, suggest
from executive.mission.model.nodes import SkillNode
from executive.mission.model.typed import WrongType, convert, input_fault
from executive.mission.model.values import Literal
from executive.mission.words import describe
from executive.skill import Direction, Param, Port


def unknown_skills(case: Case) -> Iterator[Finding]:
    """Find every skill that is not installed."""
    for node in case.nodes():
        if isinstance(node, SkillNode) and node.skill not in case.skills:
            hint = alternatives(node.skill, case.skills, "Installed skills")
            yield error(node.mark, "unknown-skill", f'there is no skill "{node.skill}"', hint)


def settings(case: Case) -> Iterator[Finding]:
    """Find every setting of a skill that is unknown, missing, or has a value that does not fit."""
    for node, skill in case.known_skills():
        known: dict[str, Param | Port] = {**skill.params, **skill.ports}
        for name, setting in node.settings.items():
            if name not in known:
                hint = alternatives(name, known, f"{node.skill} takes")
                yield error(setting.key, "unknown-param", f'{node.skill} has no param or port "{name}"', hint)
            elif isinstance(setting.value, Literal):
                yield from _value_faults(case, node, known[name], setting.value)
            elif name in skill.params:
                variable = f"${setting.value.name}"
                message = (
                    f"{node.skill}.{name} is a constant, and {variable} is neither param nor argument here"
                )
                hint = case.constant_hint(setting.value)
                yield error(setting.value.mark, "unknown-param", message, hint)
        for param in skill.params.values():
            if param.required and param.name not in node.settings:
                hint = param.doc and f"{param.name}: {param.doc}."
                yield error(node.mark, "missing-param", f'{node.skill} needs the param "{param.name}"', hint)


def _value_faults(case: Case, node: SkillNode, declared: Param | Port, value: Literal) -> Iterator[Finding]:
    """Yield a finding if a value does not fit the param or port that it is given to."""
    name, code, hint, sentence = f"{node.skill}.{declared.name}", "wrong-type", "", ""
    if isinstance(declared, Param):
        code, sentence = _param_fault(declared, value.value)
    elif declared.direction is Direction.IN:
        sentence, hint = input_fault(value.value, declared), case.variable_hint(value.value)
    else:
        sentence = f"{name} is an output: it takes the variable to write, as ${declared.name}"
        if value.origin:
            sentence = f"{name} is an output and cannot write the constant {value.origin.split()[0]}"
        yield error(value.used or value.mark, code, sentence)
        return
    if sentence:
        yield error(value.mark, code, f"{name} {sentence}{value.origin_note}", hint)


def _param_fault(param: Param, value: object) -> tuple[str, str]:
    """Return code and sentence of a value that does not fit a param; the sentence is "" if it does."""
    try:
        converted = convert(value, param.type)
    except WrongType as problem:
        return "wrong-type", str(problem)
    unit = f" {param.unit}" if param.unit else ""
    if param.ge is not None and converted < param.ge:
        return "out-of-range", f"must be at least {param.ge:g}{unit}, not {describe(value)}"
    if param.le is not None and converted > param.le:
        return "out-of-range", f"must be at most {param.le:g}{unit}, not {describe(value)}"
    # Where a param names something of the cell, its choices are further words, checked with the cell.
    if param.choices is not None and not param.refers and converted not in param.choices:
        allowed = " or ".join(
            f'"{choice}"' if isinstance(choice, str) else str(choice) for choice in param.choices
        )
        meant = suggest(value, map(str, param.choices)) if isinstance(value, str) else None
        question = f' (did you mean "{meant}"?)' if meant else ""
        return "wrong-value", f"must be {allowed}, not {describe(value)}{question}"
    return "", ""
