"""Checks of the routes and quotas of a mission."""

from __future__ import annotations

import math
from collections.abc import Iterator

from executive.mission.check.context import CheckContext
from executive.mission.check.control_nodes import check_constant
from executive.mission.findings import Finding, make_error, make_warning, suggest_choice
from executive.mission.model.values import Literal, LocatedName
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
