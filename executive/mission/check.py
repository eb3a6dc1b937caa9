"""Everything that can be known to be wrong with a mission before it runs; one function per check."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from executive.mission import check_cell, check_control, check_flow, check_reasons, check_skills
from executive.mission.case import Case
from executive.mission.findings import Finding

Check = Callable[[Case], Iterator[Finding]]

CHECKS: tuple[Check, ...] = (
    check_skills.unknown_skills,
    check_skills.unknown_settings,
    check_skills.missing_params,
    check_skills.param_values,
    check_skills.input_values,
    check_skills.output_wiring,
    check_control.numbers,
    check_cell.routes,
    check_cell.names,
    check_reasons.matches,
)
"""Checks of single places: they hold whatever else is wrong."""

FLOW_CHECKS: tuple[Check, ...] = (
    check_flow.shadowed_params,
    check_flow.unwritten_inputs,
    check_flow.broken_promises,
)
"""Checks of the whole: they say nothing useful about a tree with unknown parts."""


def check(case: Case, sound: bool) -> list[Finding]:
    """Return the findings of every check; those of the whole only for a tree that is `sound` so far."""
    found = [finding for one in CHECKS for finding in one(case)]
    if sound and not found:
        found = [finding for one in FLOW_CHECKS for finding in one(case)]
    return found
