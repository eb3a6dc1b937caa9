"""Conformance check of a skill (one rule applied to one skill), and the list of all checks."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from executive.skill import Skill
from executive.testing.conformance import behaviour_checks, declaration_checks
from executive.testing.conformance.situations import Arrange, NotTestable, SkillScene
from executive.testing.conformance.skill_runs import SkillRuns

Rule = Callable[[SkillRuns], Iterator[str]]
"""Function whose docstring states a rule; yields one text per violation: place, problem, correction."""

RULES: tuple[Rule, ...] = tuple(
    rule
    for module in (declaration_checks, behaviour_checks)
    for name, rule in vars(module).items()
    if inspect.isfunction(rule) and rule.__module__ == module.__name__ and not name.startswith("_")
)
"""All rules: the public functions of `declaration_checks` and `behaviour_checks`, in file order."""


class ConformanceError(AssertionError):
    """A skill violates a rule; the message names the rule, the place and the correction."""


@dataclass(frozen=True)
class Verdict:
    """Result of a conformance check.

    Attributes:
        skill: Name of the skill.
        check: Name of the check.
        doc: First line of the docstring of the rule.
        status: `ok`; `failed`; or `not run` if the skill could not be tested.
        problems: One text for each violation, or the reason why the check was not run.
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
        skill_runs: The test runs of the skill, which all its checks share.
        rule: The rule against which the skill is checked.
    """

    skill_runs: SkillRuns
    rule: Rule

    def __str__(self) -> str:
        return f"{self.skill_runs.name}.{self.name}"

    @property
    def name(self) -> str:
        """Name of the rule."""
        return self.rule.__name__

    def run(self) -> Verdict:
        """Apply the rule to the skill and return the result."""
        try:
            problems = tuple(self.rule(self.skill_runs))
            status = "failed" if problems else "ok"
        except NotTestable as error:
            problems, status = (str(error),), "not run"
        doc = (inspect.getdoc(self.rule) or "").partition("\n")[0]
        return Verdict(self.skill_runs.name, self.name, doc, status, problems)

    def __call__(self) -> None:
        """Run the check.

        Raises:
            ConformanceError: The skill violates the rule, or cannot be tested.
        """
        verdict = self.run()
        if verdict.problems:
            raise ConformanceError("\n".join((f"{verdict.doc} Violated:", *verdict.problems)))


def keep_scene(scene: SkillScene) -> Mapping[str, Any]:
    """Leave the scene unchanged and return no values of params and inputs."""
    del scene
    return {}


def list_conformance_checks(skill: type[Skill], arrange: Arrange = keep_scene, name: str = "") -> list[Check]:
    """Return one check per rule for a skill; the skill is run only when a check is called.

    Args:
        skill: Class of the skill.
        arrange: Function that gets the `SkillScene` of each run. The function may change the scene, and
            returns values of params and inputs by name; missing required values are generated.
        name: Name under which the skill is installed; "": the name of the class.
    """
    skill_runs = SkillRuns(name or skill.__name__, skill, arrange)
    return [Check(skill_runs, rule) for rule in RULES]
