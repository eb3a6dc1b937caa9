"""Every shipped skill does what any skill must."""

from __future__ import annotations

import pytest

from executive.discovery import discover
from executive.testing.conformance import conformance
from executive.testing.conformance.case import Case
from executive.testing.conformance.check import Check

SKILLS = {name: conformance(skill, name=name) for name, skill in discover().items()}
CHECKS = [check for checks in SKILLS.values() for check in checks]
CASES = {name: checks[0].case for name, checks in SKILLS.items()}


@pytest.mark.parametrize("check", CHECKS, ids=str)
def test_every_shipped_skill_conforms(check: Check) -> None:
    check()


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_every_reason_to_fail_is_met_by_something_that_goes_wrong(case: Case) -> None:
    assert {rehearsal.ending.reason for rehearsal in case.ended} - {""} == set(case.skill.reasons)
