"""Checks of skills and their settings, of the classes in the mission, and of routes and quotas."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated

from pydantic import Field, TypeAdapter

from executive.cell.config import CellConfig
from executive.errors import InputError
from executive.geometry import GRAVITY
from executive.manipulation.grasps import find_free_yaws
from executive.manipulation.tool_goals import MAX_ROLL_DISTANCE, make_slot_goal
from executive.mission.analysis import CheckContext
from executive.mission.cell_file import CellFile, CellFileChecker
from executive.mission.check_nodes import check_constant
from executive.mission.mission_file import Mission
from executive.mission.ports import find_literals, find_problem
from executive.skill import HOLDING, Direction, Param, Port, Skill
from executive.text.findings import Finding, Span, make_error, make_warning, suggest_choice
from executive.tree.specification import Constant, Expression, LocatedName, Reference, SkillNode

REPLACED_SKILLS = {
    "IsEqual": '$target.label == "cube"',
    "HasCounted": "run.placed >= 4",
    "HasElapsed": "run.elapsed >= 30",
}
"""Expressions in place of skills of earlier versions."""


def find_unknown_skills(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every skill that is not installed."""
    for node in context.nodes:
        if isinstance(node, SkillNode) and node.skill not in context.skills:
            hint = suggest_choice(node.skill, context.skills, "Installed skills")
            if expression := REPLACED_SKILLS.get(node.skill):
                hint = f"Write the expression `{expression}` in its place, for instance below `holds`."
            yield make_error(node.span, "unknown-skill", f'there is no skill "{node.skill}"', hint)


def check_settings(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every setting of a skill that is unknown, missing, or has an invalid value."""
    for node, skill in context.find_installed_skills(context.nodes):
        declarations: dict[str, Param | Port] = {**skill.params, **skill.ports}
        for name, value in node.settings.items():
            if name not in declarations:
                hint = suggest_choice(name, declarations, f"Params and ports of {node.skill}")
                if writers := context.list_skills_with_output(name) if skill.is_condition else "":
                    hint = f"A condition writes no output. Skills that write ${name}: {writers}."
                message = f'{node.skill} has no param or port "{name}"'
                yield make_error(name.span, "unknown-param", message, hint)
            elif isinstance(value, Expression):
                if getattr(declarations[name], "direction", None) is Direction.OUT:
                    message = f"{node.skill}.{name} is an output: give it a variable, for example ${name}"
                    yield make_error(value.span, "wrong-type", message)
            elif isinstance(value, Constant):
                yield from _check_value(context, node, declarations[name], value)
                yield from find_unknown_names(context, node.skill, declarations[name], value)
            elif isinstance(value, Reference):
                yield from _check_reference(context, node.skill, declarations[name], value)
        for param in skill.params.values():
            if param.is_required and param.name not in node.settings:
                message = f'{node.skill} needs the param "{param.name}"'
                hint = param.doc and f"{param.name}: {param.doc}."
                yield make_error(node.span, "missing-param", message, hint)
        given = [name for name in node.settings if name in skill.one_of]
        given.sort(key=skill.one_of.index)
        if skill.one_of and len(given) != 1:
            names = " or ".join(skill.one_of)
            span = given[1].span if given else node.span
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
        hint = context.make_unknown_param_hint(reference)
        if reference.name in context.written_variables:
            hint = f"For the present value of the variable, write = {reference}."
        yield make_error(reference.span, "unknown-param", message, hint)


def _check_value(
    context: CheckContext, node: SkillNode, declaration: Param | Port, value: Constant
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
    context: CheckContext, skill: str, declaration: Param | Port, value: Constant
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
    routes: dict[str, set[str]] = {label: set(bins) for label, bins in context.mission.routes.items()}
    spans: dict[str, Span] = {label: label.span for label in context.mission.routes}
    skills = (skill for _, skill in context.find_installed_skills(context.nodes))
    is_weighed = any(map(_is_weighing, skills))
    for label, section in objects.items():
        detected = section.looks_like  # The detector reports this class for objects of the class `label`.
        if detected not in objects:
            continue
        problem = f"{label} looks like {detected}"
        if label in routes and detected not in routes:
            message = f"{problem}, which has no route, so no object of either class is selected"
            yield make_error(spans[label], "unweighed", message, f"Add a route for {detected}.")
        elif detected in routes and routes.get(label) != routes[detected] and not is_weighed:
            message = f"{problem}, their routes differ, and no node weighs the held object"
            weighing_skills = [name for name, skill in context.skills.items() if _is_weighing(skill)]
            hint = f"Before the transport, insert {' or '.join(weighing_skills)}."
            yield make_error(spans.get(label, spans[detected]), "unweighed", message, hint)


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
    for node, skill in context.find_installed_skills(context.nodes):
        for param in skill.params.values():
            if param.refers_to == "detector":
                value = node.settings.get(LocatedName(param.name), param.default)
                name = value.value if isinstance(value, Constant) else value
                if isinstance(name, str):
                    used_names.update([name] if name else names[:1])  # The first detector is the default.
                else:
                    used_names.update(names)
    return used_names.intersection(names)


def _find_named_classes(context: CheckContext) -> Iterator[tuple[str, Span]]:
    """Yield every class in the routes and in the settings of skills, with its position."""
    yield from ((label, label.span) for label in context.mission.routes)
    for node, skill in context.find_installed_skills(context.nodes):
        for name, value in find_literals(node):
            declaration = skill.params.get(name) or skill.ports.get(name)
            if declaration is not None and declaration.refers_to == "class" and isinstance(value.value, str):
                yield value.value, value.span


_LIMIT: TypeAdapter[object] = TypeAdapter(Annotated[int, Field(ge=1)])
"""Validator of the limit of a quota."""


def check_names(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every class and every bin in routes and quotas that the cell lacks."""
    if context.cell is None:
        return
    routes = context.mission.routes
    quotas = context.mission.quotas
    labels = [*routes, *(label for _, label in quotas if label is not None)]
    bins = [bin for route in routes.values() for bin in route] + [bin for bin, _ in quotas]
    for kind, plural, names in (("class", "Classes", labels), ("bin", "Bins", bins)):
        allowed_names = context.names_in_cell_by_kind[kind]
        for name in names:
            if name not in allowed_names:
                hint = suggest_choice(name, allowed_names, f"{plural} of the cell")
                yield make_error(name.span, f"unknown-{kind}", f'the cell has no {kind} "{name}"', hint)


def check_quotas(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for each invalid quota or quota without a route, and a warning for too few slots."""
    for (bin, label), limit in context.mission.quotas.items():
        name = f"the quota of {bin} for {label}" if label else f"the quota of {bin}"
        yield from check_constant(context, name, _LIMIT, limit)
        if context.cell is None or bin not in context.cell.bins:
            continue
        routes = context.mission.routes.items()
        routed_bins = [routed for route, bins in routes if label in (None, route) for routed in bins]
        if bin not in routed_bins and (label is None or label in context.cell.objects):
            classes = f"the class {label}" if label else "any class"
            message = f"no route assigns {classes} to {bin}, so the quota has no effect"
            choices = dict.fromkeys(routed_bins)
            hint = suggest_choice(bin, choices, f"Bins in the routes of {classes}")
            yield make_error((label or bin).span, "no-route", message, hint)
        slot_count = math.prod(context.cell.bins[bin].slots)
        if isinstance(limit, Constant) and isinstance(limit.value, int) and limit.value > slot_count:
            message = f"the quota exceeds the {slot_count} slots of {bin}, so objects would be stacked"
            hint = f"Lower the quota to {slot_count} or less, or add slots to the bin in the cell file."
            yield make_warning(limit.span, "large-quota", message + limit.origin_note, hint)


def check_loads(
    cell: CellFile, config: CellConfig, mission: Mission, checker: CellFileChecker | None
) -> Iterator[Finding]:
    """Yield an error for each routed class that the tool cannot hold, or a warning if it may be dropped.

    The planner limits the accelerations so that the tool holds `safety_factor` times the force on the load,
    but it never lifts with less than `min_lift_acceleration`. Without a checker, only declared sizes and
    masses are checked.
    """
    safety_factor = config.tool.safety_factor
    for label in sorted(mission.routes.keys() & config.objects.keys()):
        section = config.objects[label]
        object_class = section.build_class(label)
        force = config.tool.compute_holding_force(object_class, config.tool.max_holding_force)
        if problem := config.tool.explain_unsuitable(object_class):
            hint = "Delete the route, or use another tool."
            yield make_error(cell.find_span(("objects", label), at_key=True), "robot", problem, hint)
            continue
        key = "mass" if section.mass is not None else "urdf" if section.urdf else "mesh"
        span = cell.find_span(("objects", label, key))
        hint = "Correct the mass, delete the route, or use a tool with a larger force."
        try:
            mass = checker.compute_mass(section) if checker else section.mass or 0.0
        except InputError as error:
            yield make_error(span, "robot", f"the mass of {label} is unknown: {error}", hint)
            continue
        problem = f"a {label} of {mass:g} kg"
        weight = mass * GRAVITY
        pull = mass * (GRAVITY + config.tool.min_lift_acceleration)
        if weight > force:
            message = f"{problem} weighs {weight:.1f} N, more than the {force:g} N that the tool withstands"
            yield make_error(span, "too-heavy", message, hint)
        elif checker and (measured := checker.measure_hold(config, label)) < weight:
            grip = f"holds the surface of a {label} with at most {measured:.2g} N"
            message = f"the tool {grip}, and its weight is {weight:.2g} N"
            hint = "Give the class a better grasp point, delete the route, or use another tool."
            yield make_error(cell.find_span(("objects", label), at_key=True), "robot", message, hint)
        elif pull > force / safety_factor:
            limit = f"{force:g} N / safety factor {safety_factor:g} = {force / safety_factor:.3g} N"
            message = f"{problem} pulls with {pull:.3g} N in the slowest lift, more than {limit}"
            yield make_warning(span, "too-heavy", message, hint)


def check_slots(cell: CellFile, config: CellConfig, mission: Mission) -> Iterator[Finding]:
    """Yield an error for each class and bin of a route if walls or objects beside a slot block transits.

    A bin with `place_yaw_deg` needs classes whose yaws images show.
    """
    # `list_obstacles` represents each object in a bin by a cylinder for the largest class.
    obstacle_radius = max(section.radius for section in config.objects.values()) + MAX_ROLL_DISTANCE
    for label, name in [(label, name) for label, bins in mission.routes.items() for name in bins]:
        bin = config.bins.get(name)
        section = config.objects.get(label)
        if bin is None or section is None:
            continue  # `routes.check_names` reports the name
        if bin.place_yaw_deg is not None and section.footprint is None and section.yaw_symmetry is None:
            message = f"images show no yaw of a {label} without a footprint, and {name} has a place_yaw_deg"
            hint = "Give the class a footprint, or yaw_symmetry: 0 if it is round."
            yield make_error(cell.find_span(("objects", label), at_key=True), "layout", message, hint)
        # The tool is beside the middle of the slot if the object is held beside its middle.
        offset = section.build_class(label).contact_radius * (1 if bin.place_yaw_deg is None else 2)
        radius = section.radius + offset + config.motion.margin
        for axis, size, count in zip("xy", bin.size, bin.slots, strict=False):
            min_size = radius + max(radius, obstacle_radius if count > 1 else 0.0)
            if size / count < min_size:
                problem = f"a slot of {name} is {size / count:.4f} m long along {axis}"
                message = f"{problem}, but a {label} with its clearance needs {min_size:.4f} m"
                hint = "Give the bin fewer slots or a larger size."
                yield make_error(cell.find_span(("bins", name, "slots")), "layout", message, hint)
        if problem := _explain_blocked_slot(config, name, label):
            hint = "Give the bin fewer slots, a larger size or lower walls."
            yield make_error(cell.find_span(("bins", name, "slots")), "layout", problem, hint)


def _explain_blocked_slot(config: CellConfig, name: str, label: str) -> str:
    """Return a clause about a slot of a bin without space for the fingers that release an object, or ""."""
    object_class = config.objects[label].build_class(label)
    opening = config.tool.compute_release_opening(object_class)
    hold_height = config.tool.get_hold_height(object_class)
    bin = config.bins[name].build_bin(name)
    for index in range(len(bin.slots)):
        goal = make_slot_goal(bin, index, hold_height, config.max_object_height)
        _, blocker = find_free_yaws(config.tool, opening, goal, (), (bin,), config.motion.margin)
        if blocker:
            return f"fingers cannot open to release a {label} in slot {index + 1}: {blocker} is in the way"
    return ""
