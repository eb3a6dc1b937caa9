"""What the checks say of a skill, without what depends on the machine or on where in its file it stands."""

from __future__ import annotations

import re

from executive.skill import Skill
from executive.testing.conformance import conformance

Said = dict[str, str]
"""What is said first, by the name of every check that fails."""

_PATTERNS = (
    (re.compile(r"(broken_\w+\.py):\d+"), r"\1:{line}"),
    (re.compile(r"number \d+"), "number {fd}"),
    (re.compile(r"\d+ ms in tick"), "{ms} ms in tick"),
)


def failures(skill: type[Skill]) -> Said:
    """Return what is wrong with a skill."""
    found = (check.verdict() for check in conformance(skill))
    return {verdict.check: _lasting(verdict.problems[0]) for verdict in found if verdict.status == "failed"}


def problems(skill: type[Skill], name: str) -> list[str]:
    """Return everything that a check finds wrong with a skill."""
    (check,) = (check for check in conformance(skill) if check.name == name)
    return list(check.verdict().problems)


def _lasting(text: str) -> str:
    for pattern, word in _PATTERNS:
        text = pattern.sub(word, text)
    return text
