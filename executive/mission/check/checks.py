"""Everything that can be known to be wrong with a mission before it runs; one function per check."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import islice

from executive.mission.check import (
    inner_nodes,
    parallel,
    port_types,
    reach,
    reasons,
    skills,
    variables,
)
from executive.mission.check.case import Case
from executive.mission.findings import Finding

Check = Callable[[Case], Iterator[Finding]]

CHECKS: tuple[Check, ...] = (
    skills.find_unknown_skills,
    skills.check_settings,
    inner_nodes.check_constants,
    reasons.check_labels,
    skills.check_routes,
    skills.find_unseen_classes,
    reasons.check_failure_names,
    variables.find_unwritten_inputs,
    variables.find_unwritten_library_inputs,
    variables.find_overwritten_loop_variables,
    variables.find_unread_variables,
    variables.find_unwritten_returns,
    port_types.check_port_types,
    reach.check_tool_states,
    reach.check_tool_at_end,
    reach.find_unreachable,
    inner_nodes.check_class_rules,
    parallel.find_shared_resources,
    parallel.find_shared_variables,
    parallel.find_racing_reads,
)
"""Each holds whatever else is wrong: what is unknown in one place makes no findings in others."""


MAX_FINDINGS = 1000
"""Largest number of findings of one check: hostile missions have hundreds of thousands."""


def check(case: Case) -> list[Finding]:
    """Return the findings of every check."""
    return [finding for one in CHECKS for finding in islice(one(case), MAX_FINDINGS)]
