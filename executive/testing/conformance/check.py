"""A check of a skill, and the list of all checks."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from executive.skill import Skill
from executive.testing.conformance import conduct, declarations
from executive.testing.conformance.case import Case
from executive.testing.conformance.situations import Arrange, NotTried
from executive.testing.conformance.stage import Stage

Rule = Callable[[Case], Iterator[str]]
"""Yields what is wrong with a skill: what happened, where, what to do. Its docstring says what is true."""

RULES: tuple[Rule, ...] = (
    declarations.documented,
    declarations.defaults_allowed,
    declarations.reasons_declared,
    declarations.resources_declared,
    declarations.imports_allowed,
    declarations.calls_take_effect,
    conduct.arranged,
    conduct.comes_to_an_end,
    conduct.ends_as_declared,
    conduct.outputs_fit,
    conduct.inputs_unchanged,
    conduct.uses_only_what_it_declares,
    conduct.tool_left_as_declared,
    conduct.arm_left_at_rest,
    conduct.halts_at_once,
    conduct.repeats_itself,
    conduct.ticks_are_quick,
)


class NotConforming(AssertionError):
    """A skill does not do what every skill must; the text says what, where, and what to do."""


@dataclass(frozen=True)
class Verdict:
    """Result of a check.

    Attributes:
        skill: Name of the skill.
        check: Name of the check.
        doc: What is true where it passes.
        status: `ok`, `failed`, or `not run` where the skill cannot be tried.
        problems: What is wrong, a text each.
    """

    skill: str
    check: str
    doc: str
    status: str
    problems: tuple[str, ...] = ()


@dataclass(frozen=True)
class Check:
    """A rule to hold a skill to; called, it returns if the skill keeps it.

    Attributes:
        case: The skill.
        rule: The rule.
    """

    case: Case
    rule: Rule

    def __str__(self) -> str:
        return f"{self.case.name}.{self.name}"

    @property
    def name(self) -> str:
        """Name of the rule."""
        return self.rule.__name__

    @property
    def doc(self) -> str:
        """What is true of a skill that keeps the rule, in one line."""
        return (inspect.getdoc(self.rule) or "").partition("\n")[0]

    def verdict(self) -> Verdict:
        """Return what the check finds."""
        try:
            problems = tuple(self.rule(self.case))
        except NotTried as problem:
            return Verdict(self.case.name, self.name, self.doc, "not run", (str(problem),))
        return Verdict(self.case.name, self.name, self.doc, "failed" if problems else "ok", problems)

    def __call__(self) -> None:
        """Return if the skill keeps the rule.

        Raises:
            NotConforming: It does not, or this cannot be found out.
        """
        verdict = self.verdict()
        if verdict.problems:
            raise NotConforming("\n".join((f"{self.doc} Not so:", *verdict.problems)))


def nothing_to_add(stage: Stage) -> Mapping[str, Any]:
    """Leave the stage as it is."""
    del stage
    return {}


def conformance(skill: type[Skill], arrange: Arrange = nothing_to_add, name: str = "") -> list[Check]:
    """Return every check of a skill, to be called one by one; nothing is run before.

    Args:
        skill: Its class.
        arrange: Gets a `Stage` for every situation, may change it, and returns values for those params and
            inputs that cannot be made up, or should be others.
        name: Name under which the skill is installed; by default that of its class.
    """
    case = Case(name or skill.__name__, skill, arrange)
    return [Check(case, rule) for rule in RULES]
