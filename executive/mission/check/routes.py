"""Checks of routes and quotas: names, quotas, weights of the classes, and sizes of the slots."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from executive.cell.config import CellConfig, ObjectConfig
from executive.cell.objects import MIN_LIFT_ACCELERATION, SAFETY_FACTOR
from executive.errors import InputError
from executive.geometry import GRAVITY
from executive.manipulation.tool_goals import MAX_ROLL_DISTANCE
from executive.mission.check.context import CheckContext
from executive.mission.check.control_nodes import check_constant
from executive.mission.findings import Finding, make_error, make_warning, suggest_choice
from executive.mission.model.mission import Mission
from executive.mission.model.values import Literal, LocatedName
from executive.mission.parse.cell_file import CellFile
from executive.tree.keys import Key

_LIMIT_KEY = Key(doc="Maximum number of objects.", ge=1, value_type=int)
"""Type and minimum of the limit of a quota, in the form that `check_constant` accepts."""


def check_names(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every class and every bin in routes and quotas that the cell lacks."""
    if context.cell is None:
        return
    routes, quotas = context.mission.routes, context.mission.quotas
    labels = [LocatedName(route.label, route.label_span) for route in routes]
    labels += [quota.label for quota in quotas if quota.label is not None]
    bins = [bin for route in routes for bin in route.bins] + [quota.bin for quota in quotas]
    for kind, plural, names in (("class", "Classes", labels), ("bin", "Bins", bins)):
        allowed_names = context.names_in_cell_by_kind[kind]
        for name in names:
            if name.name not in allowed_names:
                hint = suggest_choice(name.name, allowed_names, f"{plural} of the cell")
                yield make_error(name.span, f"unknown-{kind}", f'the cell has no {kind} "{name.name}"', hint)


def check_quotas(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for each invalid quota or quota without a route, and a warning for too few slots."""
    for quota in context.mission.quotas:
        bin, label, limit = quota.bin, quota.label, quota.limit
        yield from check_constant(context, str(quota), _LIMIT_KEY, limit)
        if context.cell is None or bin.name not in context.cell.bins:
            continue
        routes = [route for route in context.mission.routes if label is None or route.label == label.name]
        routed_bins = list(dict.fromkeys(routed_bin.name for route in routes for routed_bin in route.bins))
        if bin.name not in routed_bins and (label is None or label.name in context.cell.objects):
            classes = f"the class {label.name}" if label else "any class"
            message = f"no route assigns {classes} to {bin.name}, so the quota has no effect"
            hint = suggest_choice(bin.name, routed_bins, f"Bins in the routes of {classes}")
            yield make_error((label or bin).span, "no-route", message, hint)
        slot_count = math.prod(context.cell.bins[bin.name].slots)
        if isinstance(limit, Literal) and isinstance(limit.value, int) and limit.value > slot_count:
            message = f"the quota exceeds the {slot_count} slots of {bin.name}, so objects would be stacked"
            hint = f"Lower the quota to {slot_count} or less, or add slots to the bin in the cell file."
            yield make_warning(limit.span, "large-quota", message + limit.origin_note, hint)


def check_weights(
    cell: CellFile, config: CellConfig, mission: Mission, compute_mass: Callable[[ObjectConfig], float] | None
) -> Iterator[Finding]:
    """Yield an error for each routed class that is too heavy for the tool, or a warning if it may be dropped.

    The planner limits the accelerations so that the seal withstands `SAFETY_FACTOR` times the force, but it
    never lifts with less than `MIN_LIFT_ACCELERATION`. `compute_mass` is that of `CellKind`; if it is None,
    only classes with a declared mass are checked.
    """
    force = config.tool.force
    for label in sorted({route.label for route in mission.routes} & config.objects.keys()):
        section = config.objects[label]
        key = "mass" if section.mass is not None else "urdf" if section.urdf else "mesh"
        span = cell.find_span(("objects", label, key))
        hint = "Correct the mass, delete the route, or use a tool with a larger force."
        try:
            mass = compute_mass(section) if compute_mass else section.mass or 0.0
        except InputError as error:
            yield make_error(span, "robot", f"the mass of {label} is unknown: {error}", hint)
            continue
        problem = f"a {label} of {mass:g} kg"
        weight = mass * GRAVITY
        pull = mass * (GRAVITY + MIN_LIFT_ACCELERATION)
        if weight > force:
            message = f"{problem} weighs {weight:.1f} N, more than the {force:g} N that the tool withstands"
            yield make_error(span, "too-heavy", message, hint)
        elif pull > force / SAFETY_FACTOR:
            limit = f"{force:g} N / safety factor {SAFETY_FACTOR:g} = {force / SAFETY_FACTOR:.3g} N"
            message = f"{problem} pulls with {pull:.1f} N in the slowest lift, more than {limit}"
            yield make_warning(span, "too-heavy", message, hint)


def check_slots(cell: CellFile, config: CellConfig, mission: Mission) -> Iterator[Finding]:
    """Yield an error for each class and bin of a route if walls or objects beside a slot block transits."""
    # `list_obstacles` represents each object in a bin by a cylinder for the largest class.
    obstacle_radius = max(section.radius for section in config.objects.values()) + MAX_ROLL_DISTANCE
    for label, name in [(route.label, bin.name) for route in mission.routes for bin in route.bins]:
        bin, section = config.bins.get(name), config.objects.get(label)
        if bin is None or section is None:
            continue  # `routes.check_names` reports the name
        radius = section.radius + section.ring + config.motion.margin
        for axis, size, count in zip("xy", bin.size, bin.slots, strict=False):
            min_size = radius + max(radius, obstacle_radius if count > 1 else 0.0)
            if size / count < min_size:
                problem = f"a slot of {name} is {size / count:.4f} m long along {axis}"
                message = f"{problem}, but a {label} with its clearance needs {min_size:.4f} m"
                hint = "Give the bin fewer slots or a larger size."
                yield make_error(cell.find_span(("bins", name, "slots")), "layout", message, hint)
