"""Checks of skills and their settings, and of the classes in the mission."""

from __future__ import annotations

from collections.abc import Iterator

from executive.mission.check.context import CheckContext
from executive.mission.check.variables import list_skills_with_output
from executive.mission.findings import Finding, make_error, suggest_choice
from executive.mission.model.conversion import find_problem
from executive.mission.model.nodes import SkillNode
from executive.mission.model.values import Literal, Reference
from executive.mission.model.wiring import find_literals
from executive.mission.source import Span
from executive.skill import HOLDING, Direction, Param, Port, Skill


def find_unknown_skills(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every skill that is not installed."""
    for node in context.iterate_nodes():
        if isinstance(node, SkillNode) and node.skill not in context.skills:
            hint = suggest_choice(node.skill, context.skills, "Installed skills")
            yield make_error(node.span, "unknown-skill", f'there is no skill "{node.skill}"', hint)


def check_settings(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every setting of a skill that is unknown, missing, or has an invalid value."""
    for node, skill in context.find_installed_skills(context.iterate_nodes()):
        declarations: dict[str, Param | Port] = {**skill.params, **skill.ports}
        for name, setting in node.settings.items():
            if name not in declarations:
                hint = suggest_choice(name, declarations, f"Params and ports of {node.skill}")
                if writers := list_skills_with_output(context, name) if skill.is_condition else "":
                    hint = f"A condition writes no output. Skills that write ${name}: {writers}."
                message = f'{node.skill} has no param or port "{name}"'
                yield make_error(setting.name_span, "unknown-param", message, hint)
            elif isinstance(setting.value, Literal):
                yield from _check_value(context, node, declarations[name], setting.value)
                yield from find_unknown_names(context, node.skill, declarations[name], setting.value)
            elif isinstance(setting.value, Reference):
                yield from _check_reference(context, node.skill, declarations[name], setting.value)
        for param in skill.params.values():
            if param.is_required and param.name not in node.settings:
                message = f'{node.skill} needs the param "{param.name}"'
                hint = param.doc and f"{param.name}: {param.doc}."
                yield make_error(node.span, "missing-param", message, hint)
        given = [node.settings[name] for name in skill.one_of if name in node.settings]
        if skill.one_of and len(given) != 1:
            names = " or ".join(skill.one_of)
            span = given[1].name_span if given else node.span
            message = f"{node.skill} needs exactly one of its inputs {names}, not {len(given)}"
            yield make_error(span, "exactly-one", message)


def _check_reference(
    context: CheckContext, skill: str, declaration: Param | Port, reference: Reference
) -> Iterator[Finding]:
    """Yield an error for a variable in place of a constant, and for an output that writes a field."""
    name = f"{skill}.{declaration.name}"
    if isinstance(declaration, Port):
        if declaration.direction is Direction.OUT and reference.field:
            message = f"{name} is an output: it writes a whole variable, not the field {reference.field}"
            yield make_error(reference.span, "wrong-type", message, f"Write ${reference.local_name}.")
    elif not declaration.accepts_variable or reference.name not in context.written_variables:
        message = f"{name} must be a constant, but ${reference.name} is neither a param nor an argument"
        yield make_error(reference.span, "unknown-param", message, context.make_unknown_param_hint(reference))


def _check_value(
    context: CheckContext, node: SkillNode, declaration: Param | Port, value: Literal
) -> Iterator[Finding]:
    """Yield an error if the constant `value` does not fit the param or port of `declaration`."""
    name = f"{node.skill}.{declaration.name}"
    if isinstance(declaration, Port) and declaration.direction is Direction.OUT:
        message = f"{name} is an output: give it a variable, for example ${declaration.name}"
        if value.origin:
            message = f"{name} is an output and cannot write to the constant {value.origin.split()[0]}"
        yield make_error(value.reference_span or value.span, "wrong-type", message)
    elif problem := find_problem(value.value, declaration):
        hint = context.make_variable_hint(value.value) if isinstance(declaration, Port) else ""
        yield make_error(value.span, problem.code, f"{name} {problem}{value.origin_note}", hint)


def find_unknown_names(
    context: CheckContext, skill: str, declaration: Param | Port, value: Literal
) -> Iterator[Finding]:
    """Yield an error for each constant that names a bin, class, pose or detector that the cell lacks."""
    if declaration.refers_to not in context.names_in_cell_by_kind or value.value == declaration.default:
        return
    choices = declaration.choices if isinstance(declaration, Param) else None
    allowed_names = [*context.names_in_cell_by_kind[declaration.refers_to], *(choices or ())]
    for index, name in enumerate(value.value if isinstance(value.value, list) else [value.value]):
        if isinstance(name, str) and name not in allowed_names:
            message = f'the cell has no {declaration.refers_to} "{name}" for {skill}.{declaration.name}'
            hint = context.make_variable_hint(name) or suggest_choice(name, allowed_names, "Allowed names")
            yield make_error(value.get_element_span(index), f"unknown-{declaration.refers_to}", message, hint)


def find_unweighed_classes(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every class whose bin depends on the weight of the object, if no node weighs it.

    A skill counts as weighing if the tool holds an object before and after it, and an output names a bin.
    """
    objects = {} if context.cell is None else context.cell.objects
    routes = {route.label: route for route in context.mission.routes}
    bins = {label: {bin.name for bin in route.bins} for label, route in routes.items()}
    weighing_skills = [name for name, skill in context.skills.items() if _is_weighing(skill)]
    skills = (skill for _, skill in context.find_installed_skills(context.iterate_nodes()))
    is_weighed = any(map(_is_weighing, skills))
    for label, section in objects.items():
        detected = section.looks_like  # The detector reports this class for objects of the class `label`.
        if detected not in objects:
            continue
        if label in routes and detected not in routes:
            message = (
                f"{label} looks like {detected}, which has no route, so no object of either class is selected"
            )
            yield make_error(routes[label].label_span, "unweighed", message, f"Add a route for {detected}.")
        elif detected in routes and bins.get(label) != bins[detected] and not is_weighed:
            message = (
                f"{label} looks like {detected}, their routes differ, and no node weighs the held object"
            )
            hint = f"Before the transport, insert {' or '.join(weighing_skills)}."
            yield make_error(routes.get(label, routes[detected]).label_span, "unweighed", message, hint)


def _is_weighing(skill: type[Skill]) -> bool:
    outputs = (port for port in skill.ports.values() if port.direction is Direction.OUT)
    return skill.tool_state == (HOLDING, HOLDING) and any(port.refers_to == "bin" for port in outputs)


def find_undetectable_classes(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every class in the mission that none of its detectors can detect."""
    classes_by_detector = context.classes_by_detector
    detectors = {name: classes for name, classes in classes_by_detector.items() if classes is not None}
    used_names = _find_used_detectors(context)
    if not used_names <= detectors.keys() or not used_names or context.cell is None:
        # A detector with unknown classes may detect every class.
        return
    for label, span in _find_named_classes(context):
        section = context.cell.objects.get(label)
        detected = label if section is None else section.looks_like or label
        if section is not None and not any(detected in detectors[name] for name in used_names):
            descriptions = "; ".join(f"{name}: {', '.join(classes)}" for name, classes in detectors.items())
            message = f'no detector that the mission asks can detect the class "{label}"'
            hint = f"Classes by detector: {descriptions}. Train another detector with `executive train`."
            yield make_error(span, "unseen-class", message, hint)


def _find_used_detectors(context: CheckContext) -> set[str]:
    """Return the names of the detectors that skills of the mission ask; a variable may name each detector."""
    names = list(context.classes_by_detector)
    used_names: set[str] = set()
    for node, skill in context.find_installed_skills(context.iterate_nodes()):
        for param in skill.params.values():
            if param.refers_to == "detector":
                value = node.settings[param.name].value if param.name in node.settings else param.default
                name = value.value if isinstance(value, Literal) else value
                if isinstance(name, str):
                    used_names.update([name] if name else names[:1])  # The first detector is the default.
                else:
                    used_names.update(names)
    return used_names.intersection(names)


def _find_named_classes(context: CheckContext) -> Iterator[tuple[str, Span]]:
    """Yield every class in the routes and in the settings of skills, with its position."""
    yield from ((route.label, route.label_span) for route in context.mission.routes)
    for node, skill in context.find_installed_skills(context.iterate_nodes()):
        for name, value in find_literals(node):
            declaration = skill.params.get(name) or skill.ports.get(name)
            if declaration is not None and declaration.refers_to == "class" and isinstance(value.value, str):
                yield value.value, value.span
