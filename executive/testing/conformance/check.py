"""A check of a skill, and the list of all checks."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from executive.skill import Skill
from executive.testing.conformance import conduct, declarations
from executive.testing.conformance.situations import Arrange, NotTried, Stage
from executive.testing.conformance.skill_runs import SkillRuns

Rule = Callable[[SkillRuns], Iterator[str]]
"""Yields the violations by a skill, with place and correction. The docstring states the rule."""

RULES: tuple[Rule, ...] = tuple(
    rule
    for module in (declarations, conduct)
    for name, rule in vars(module).items()
    if inspect.isfunction(rule) and rule.__module__ == module.__name__ and not name.startswith("_")
)
"""The public functions of `declarations` and `conduct`, in the order of their definition."""


class ConformanceError(AssertionError):
    """A skill violates a rule; the text names the rule, the place and the correction."""


@dataclass(frozen=True)
class Verdict:
    """Result of a check.

    Attributes:
        skill: Name of the skill.
        check: Name of the check.
        doc: The rule, as a sentence.
        status: `ok`, `failed`, or `not run` if the skill cannot be tried.
        problems: One text for each violation.
    """

    skill: str
    check: str
    doc: str
    status: str
    problems: tuple[str, ...] = ()


@dataclass(frozen=True)
class Check:
    """One rule applied to one skill; a call raises `ConformanceError` if the skill violates the rule.

    Attributes:
        skill_runs: The runs of the skill.
        rule: The rule.
    """

    skill_runs: SkillRuns
    rule: Rule

    def __str__(self) -> str:
        return f"{self.skill_runs.name}.{self.name}"

    @property
    def name(self) -> str:
        """Name of the rule."""
        return self.rule.__name__

    @property
    def doc(self) -> str:
        """First line of the rule's docstring."""
        return (inspect.getdoc(self.rule) or "").partition("\n")[0]

    def run(self) -> Verdict:
        """Apply the rule to the skill and return the result."""
        try:
            problems = tuple(self.rule(self.skill_runs))
            status = "failed" if problems else "ok"
        except NotTried as problem:
            problems, status = (str(problem),), "not run"
        return Verdict(self.skill_runs.name, self.name, self.doc, status, problems)

    def __call__(self) -> None:
        """Run the check.

        Raises:
            ConformanceError: The skill violates the rule, or cannot be tried.
        """
        verdict = self.run()
        if verdict.problems:
            raise ConformanceError("\n".join((f"{self.doc} Violated:", *verdict.problems)))


def leave_as_is(stage: Stage) -> Mapping[str, Any]:
    """Leave the stage as it is, and give no values."""
    del stage
    return {}


def conformance(skill: type[Skill], arrange: Arrange = leave_as_is, name: str = "") -> list[Check]:
    """Return all checks of a skill; the skill is run only when a check is called.

    Args:
        skill: Class of the skill.
        arrange: Called with the `Stage` of each situation. It may change the stage, and returns values for
            the params and inputs that cannot be generated, or should differ from the generated ones.
        name: Name under which the skill is installed; by default that of its class.
    """
    runs = SkillRuns(name or skill.__name__, skill, arrange)
    return [Check(runs, rule) for rule in RULES]
