"""Checks of the quotas of a mission against its routes and its cell."""

from __future__ import annotations

import math
from collections.abc import Iterator

from executive.mission.check.context import CheckContext
from executive.mission.findings import Finding, make_error, make_warning, suggest_choice
from executive.mission.model.mission import Quota


def check_quotas(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every quota that has no effect, and a warning if objects would lie on others."""
    if context.cell is None:
        return
    for quota in context.mission.quotas:
        bin, label = quota.bin, quota.label
        if bin.name not in context.cell.bins:
            hint = suggest_choice(bin.name, context.cell.bins, "Bins of the cell")
            yield make_error(bin.span, "unknown-bin", f'the cell has no bin "{bin.name}"', hint)
        elif label is not None and label.name not in context.cell.objects:
            hint = suggest_choice(label.name, context.cell.objects, "Classes of the cell")
            yield make_error(label.span, "unknown-class", f'the cell has no class "{label.name}"', hint)
        else:
            yield from _find_missing_route(context, quota)
            slot_count = math.prod(context.cell.bins[bin.name].slots)
            if isinstance(quota.limit.value, int) and quota.limit.value > slot_count:
                message = f"{bin.name} has {slot_count} slots, so the quota lets objects fall onto others"
                hint = f"Write at most {slot_count}, or more slots in the cell file."
                yield make_warning(quota.limit.span, "large-quota", message + quota.limit.origin_note, hint)


def _find_missing_route(context: CheckContext, quota: Quota) -> Iterator[Finding]:
    """Yield an error if no route leads the objects of a quota to its bin."""
    bins_by_label = {route.label: [bin.name for bin in route.bins] for route in context.mission.routes}
    labels = bins_by_label if quota.label is None else [quota.label.name]
    if any(quota.bin.name in bins_by_label.get(label, ()) for label in labels):
        return
    place, objects = quota.label or quota.bin, quota.label.name if quota.label else "any class"
    message = f"no route leads objects of {objects} to {quota.bin.name}, so the quota has no effect"
    routed_bins = dict.fromkeys(bin for label in labels for bin in bins_by_label.get(label, ()))
    hint = suggest_choice(quota.bin.name, routed_bins, f"Bins in the routes of {objects}")
    yield make_error(place.span, "no-route", message, hint)
