"""Checks of single skills, their settings, and the names that a mission takes from its cell."""

from __future__ import annotations

from collections.abc import Iterator

from executive.mission.check.case import Case
from executive.mission.findings import Finding, alternatives, error, suggest
from executive.mission.model.nodes import SkillNode
from executive.mission.model.typed import WrongType, convert, find_input_problem
from executive.mission.model.values import Literal
from executive.mission.model.wiring import find_literals
from executive.mission.source import Mark
from executive.mission.words import describe
from executive.skill import Direction, Param, Port


def find_unknown_skills(case: Case) -> Iterator[Finding]:
    """Find every skill that is not installed."""
    for node in case.nodes():
        if isinstance(node, SkillNode) and node.skill not in case.skills:
            hint = alternatives(node.skill, case.skills, "Installed skills")
            yield error(node.mark, "unknown-skill", f'there is no skill "{node.skill}"', hint)


def check_settings(case: Case) -> Iterator[Finding]:
    """Find every setting of a skill that is unknown, missing, or has a value that does not fit."""
    for node, skill in case.known_skills():
        known: dict[str, Param | Port] = {**skill.params, **skill.ports}
        for name, setting in node.settings.items():
            if name not in known:
                hint = alternatives(name, known, f"{node.skill} takes")
                yield error(setting.key, "unknown-param", f'{node.skill} has no param or port "{name}"', hint)
            elif isinstance(setting.value, Literal):
                yield from _check_value(case, node, known[name], setting.value)
                yield from _find_unknown_names(case, node, known[name], setting.value)
            elif name in skill.params:
                variable = f"${setting.value.name}"
                message = (
                    f"{node.skill}.{name} is a constant, and {variable} is neither param nor argument here"
                )
                hint = case.constant_hint(setting.value)
                yield error(setting.value.mark, "unknown-param", message, hint)
        for param in skill.params.values():
            if param.is_required and param.name not in node.settings:
                hint = param.doc and f"{param.name}: {param.doc}."
                yield error(node.mark, "missing-param", f'{node.skill} needs the param "{param.name}"', hint)


def _check_value(case: Case, node: SkillNode, declared: Param | Port, value: Literal) -> Iterator[Finding]:
    """Yield a finding if a value does not fit the param or port that it is given to."""
    name, code, hint, sentence = f"{node.skill}.{declared.name}", "wrong-type", "", ""
    if isinstance(declared, Param):
        code, sentence = find_param_problem(declared, value.value)
    elif declared.direction is Direction.IN:
        sentence, hint = find_input_problem(value.value, declared), case.variable_hint(value.value)
    else:
        sentence = f"{name} is an output: it takes the variable to write, as ${declared.name}"
        if value.origin:
            sentence = f"{name} is an output and cannot write the constant {value.origin.split()[0]}"
        yield error(value.reference_mark or value.mark, code, sentence)
        return
    if sentence:
        yield error(value.mark, code, f"{name} {sentence}{value.origin_note}", hint)


def _find_unknown_names(
    case: Case, node: SkillNode, declared: Param | Port, value: Literal
) -> Iterator[Finding]:
    """Find every name of something that the cell does not have."""
    if declared.refers not in case.names or value.value == declared.default:
        return
    choices = declared.choices if isinstance(declared, Param) else None
    words = [*case.names[declared.refers], *(choices or ())]
    name, listed = f"{node.skill}.{declared.name}", isinstance(value.value, list)
    for index, word in enumerate(value.value if isinstance(value.value, list) else [value.value]):
        if isinstance(word, str) and word not in words:
            message = f'the cell has no {declared.refers} "{word}" for {name}'
            hint = case.variable_hint(word) or alternatives(word, words, f"{name} takes")
            mark = value.element_mark(index) if listed else value.mark
            yield error(mark, f"unknown-{declared.refers}", message, hint)


def find_param_problem(param: Param, value: object) -> tuple[str, str]:
    """Return code and sentence of a value that does not fit a param; the sentence is "" if it does."""
    try:
        converted = convert(value, param.type)
    except WrongType as problem:
        return "wrong-type", str(problem)
    unit = f" {param.unit}" if param.unit else ""
    number = converted if isinstance(converted, int | float) else None
    if number is not None and param.ge is not None and number < param.ge:
        return "out-of-range", f"must be at least {param.ge:g}{unit}, not {describe(value)}"
    if number is not None and param.le is not None and number > param.le:
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


def check_routes(case: Case) -> Iterator[Finding]:
    """Find every route of an unknown class or to an unknown bin."""
    if case.cell is None:
        return
    for route in case.mission.routes:
        if route.label not in case.cell.objects:
            hint = alternatives(route.label, case.cell.objects, "Its classes")
            yield error(route.key, "unknown-class", f'the cell knows no class "{route.label}"', hint)
        for bin in route.bins:
            if bin.name not in case.cell.bins:
                hint = alternatives(bin.name, case.cell.bins, "Its bins")
                yield error(bin.mark, "unknown-bin", f'the cell has no bin "{bin.name}"', hint)


def find_unseen_classes(case: Case) -> Iterator[Finding]:
    """Find every class that the mission names and no detector's model knows."""
    models = {name: labels for name, labels in case.labels.items() if labels is not None}
    if len(models) < len(case.labels) or not models or case.cell is None:
        # A detector whose classes are not known may know any.
        return
    for label, mark in _named_classes(case):
        if label in case.cell.objects and not any(label in labels for labels in models.values()):
            said = "; ".join(f"{name}: {', '.join(labels)}" for name, labels in models.items())
            message = f'no detector of the cell can see the class "{label}"'
            hint = f"Their models know {said}. `executive dataset` and `executive train` make another model."
            yield error(mark, "unseen-class", message, hint)


def _named_classes(case: Case) -> Iterator[tuple[str, Mark]]:
    """Yield every class in the routes and in the settings of skills, with its place."""
    yield from ((route.label, route.key) for route in case.mission.routes)
    for node, skill in case.known_skills():
        for name, value in find_literals(node):
            declared = skill.params.get(name) or skill.ports.get(name)
            if declared is not None and declared.refers == "class" and isinstance(value.value, str):
                yield value.value, value.mark
