"""Everything that can be known to be wrong with a mission before it runs; one function per check."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from executive.mission import (
    check_cell,
    check_control,
    check_labels,
    check_parallel,
    check_reach,
    check_reasons,
    check_skills,
    check_time,
    check_tool,
    check_types,
    check_variables,
)
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
    check_control.constants,
    check_labels.labels,
    check_cell.routes,
    check_cell.names,
    check_cell.known_classes,
    check_reasons.matches,
    check_variables.unwritten_inputs,
    check_variables.unread_variables,
    check_variables.broken_promises,
    check_types.port_types,
    check_types.element_names,
    check_tool.tool_states,
    check_tool.held_at_the_end,
    check_reach.unreachable,
    check_reach.shadowed_catches,
    check_reach.endless_loops,
    check_reach.unchanging_retries,
    check_reach.single_attempts,
    check_parallel.shared_resources,
    check_parallel.shared_variables,
    check_time.short_timeouts,
)
"""Each holds whatever else is wrong: what is unknown in one place makes no findings in others."""


def check(case: Case) -> list[Finding]:
    """Return the findings of every check."""
    return [finding for one in CHECKS for finding in one(case)]
