"""Checks of what a mission says about single skills."""

from __future__ import annotations

from collections.abc import Iterator

from executive.mission.check.case import Case
from executive.mission.findings import Finding, alternatives, error, suggest
from executive.mission.model.nodes import SkillNode
from executive.mission.model.typed import WrongType, convert, input_fault
from executive.mission.model.values import Literal, Reference
from executive.mission.model.wiring import literals
from executive.mission.words import describe
from executive.skill import Direction, Param


def unknown_skills(case: Case) -> Iterator[Finding]:
    """Find every skill that is not installed."""
    for node in case.nodes():
        if isinstance(node, SkillNode) and node.skill not in case.skills:
            hint = alternatives(node.skill, case.skills, "Installed skills")
            yield error(node.mark, "unknown-skill", f'there is no skill "{node.skill}"', hint)


def unknown_settings(case: Case) -> Iterator[Finding]:
    """Find every key that is neither param nor port of its skill."""
    for node, skill in case.known_skills():
        known = [*skill.params, *skill.ports]
        for name, setting in node.settings.items():
            if name not in known:
                message = f'{node.skill} has no param or port "{name}"'
                yield error(
                    setting.key, "unknown-param", message, alternatives(name, known, f"{node.skill} takes")
                )


def missing_params(case: Case) -> Iterator[Finding]:
    """Find every param without default that the mission does not give."""
    for node, skill in case.known_skills():
        for param in skill.params.values():
            if param.required and param.name not in node.settings:
                message = f'{node.skill} needs the param "{param.name}"'
                hint = param.doc and f"{param.name}: {param.doc}."
                yield error(node.mark, "missing-param", message, hint)


def param_values(case: Case) -> Iterator[Finding]:
    """Find every param with a value of the wrong type, out of range, or not known before the run."""
    for node, skill in case.known_skills():
        for name, setting in node.settings.items():
            if name not in skill.params:
                continue
            if isinstance(setting.value, Reference):
                yield _variable_for_param(case, node, name, setting.value)
            elif fault := _param_fault(skill.params[name], setting.value.value):
                code, sentence = fault
                yield _wrong(node, name, setting.value, code, sentence)


def input_values(case: Case) -> Iterator[Finding]:
    """Find every value given to an input that it cannot take."""
    for node, skill in case.known_skills():
        for name, value in literals(node):
            port = skill.ports.get(name)
            if port is None or port.direction is not Direction.IN:
                continue
            if sentence := input_fault(value.value, port):
                yield _wrong(node, name, value, "wrong-type", sentence, case.variable_hint(value.value))


def output_wiring(case: Case) -> Iterator[Finding]:
    """Find every output that is given a value instead of the name of a variable."""
    for node, skill in case.known_skills():
        for name, value in literals(node):
            port = skill.ports.get(name)
            if port is None or port.direction is not Direction.OUT:
                continue
            sentence = f"is an output: it takes the variable to write, as ${name}"
            if value.origin:
                sentence = f"is an output and cannot write the constant {value.origin.split()[0]}"
            yield error(value.used or value.mark, "wrong-type", f"{node.skill}.{name} {sentence}")


def _param_fault(param: Param, value: object) -> tuple[str, str] | None:
    """Return code and sentence of what is wrong with a value, or None."""
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
    return None


def _wrong(node: SkillNode, name: str, value: Literal, code: str, sentence: str, hint: str = "") -> Finding:
    origin = f" (it is {value.origin})" if value.origin else ""
    return error(value.mark, code, f"{node.skill}.{name} {sentence}{origin}", hint)


def _variable_for_param(case: Case, node: SkillNode, name: str, reference: Reference) -> Finding:
    message = f"{node.skill}.{name} is a constant, and ${reference.name} is neither param nor argument here"
    return error(reference.mark, "unknown-param", message, case.constant_hint(reference))
