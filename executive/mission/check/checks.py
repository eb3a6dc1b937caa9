"""List of all checks, and their execution."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import islice

from executive.mission.check import (
    connection_types,
    control_nodes,
    parallel_branches,
    reachability,
    reasons,
    routes,
    skill_settings,
    variables,
)
from executive.mission.check.context import CheckContext
from executive.mission.findings import Finding

Check = Callable[[CheckContext], Iterator[Finding]]
"""Function that yields the findings of one check."""

CHECKS: tuple[Check, ...] = (
    skill_settings.find_unknown_skills,
    skill_settings.check_settings,
    control_nodes.check_constants,
    reasons.check_labels,
    routes.check_names,
    routes.check_quotas,
    skill_settings.find_undetectable_classes,
    skill_settings.find_unweighed_classes,
    reasons.check_failure_names,
    variables.find_unwritten_inputs,
    variables.find_unwritten_library_inputs,
    variables.find_overwritten_loop_variables,
    variables.find_unread_variables,
    variables.find_unwritten_returns,
    connection_types.check_port_types,
    reachability.check_tool_states,
    reachability.check_tool_at_end,
    reachability.find_unreachable,
    control_nodes.run_node_checks,
    parallel_branches.find_shared_resources,
    parallel_branches.find_shared_variables,
    parallel_branches.find_read_races,
)
"""All checks; a check ignores the errors that another check reports, and their consequences."""

MAX_FINDINGS_PER_CHECK = 1000
"""Maximum number of findings of one check; a short mission can cause hundreds of thousands of findings."""


def run_checks(context: CheckContext) -> list[Finding]:
    """Return the findings of all checks."""
    return [finding for check in CHECKS for finding in islice(check(context), MAX_FINDINGS_PER_CHECK)]
