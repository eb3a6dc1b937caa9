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
    skills.unknown_skills,
    skills.settings,
    inner_nodes.constants,
    reasons.labels,
    skills.routes,
    skills.known_classes,
    reasons.matches,
    variables.unwritten_inputs,
    variables.unwritten_needs,
    variables.taken_names,
    variables.unread_variables,
    variables.broken_promises,
    port_types.port_types,
    reach.tool_states,
    reach.held_at_the_end,
    reach.unreachable,
    inner_nodes.complaints,
    parallel.shared_resources,
    parallel.shared_variables,
    parallel.racing_reads,
)
"""Each holds whatever else is wrong: what is unknown in one place makes no findings in others."""


MAX_FINDINGS = 1000
"""Largest number of findings of one check: hostile missions have hundreds of thousands."""


def check(case: Case) -> list[Finding]:
    """Return the findings of every check."""
    return [finding for one in CHECKS for finding in islice(one(case), MAX_FINDINGS)]
