"""One check of one skill: a thing that is true of it if it conforms."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from traceback import extract_tb

from executive.testing.conformance.case import Case
from executive.testing.conformance.patience import Stuck, patience
from executive.testing.conformance.situations import NotTried
from executive.testing.conformance.source import place_in

Rule = Callable[[Case], Iterator[str]]
"""Yields what is wrong with a skill: what happened, where, what to do. Its docstring says what is true."""


class NotConforming(AssertionError):
    """A skill does not do what every skill must; the text says what, where, and what to do."""


class Interrupted(KeyboardInterrupt):
    """Somebody did not want to wait any longer; the text says which check was under way, and where."""


@dataclass(frozen=True)
class Verdict:
    """What a check found.

    Attributes:
        skill: Name of the skill.
        check: Name of the check.
        doc: What is true where it passes.
        status: `ok`, `failed`, or `not run` where what it looks at cannot be found out.
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
        """A short name, of the rule alone."""
        return self.rule.__name__

    @property
    def doc(self) -> str:
        """What is true of a skill that keeps the rule, in one line."""
        return (inspect.getdoc(self.rule) or "").partition("\n")[0]

    def verdict(self) -> Verdict:
        """Return what the check finds.

        Raises:
            Interrupted: Somebody pressed Ctrl-C meanwhile.
        """
        try:
            with patience(self.case.skill, lambda: self.case.tries):
                problems = tuple(self.rule(self.case))
        except NotTried as problem:
            return Verdict(self.case.name, self.name, self.doc, "not run", (str(problem),))
        except Stuck as stuck:
            problems = (f"what {self} asks of it {stuck}. Whatever is asked of a skill is answered at once.",)
        except KeyboardInterrupt as interrupt:
            trace = reversed(extract_tb(interrupt.__traceback__))
            place = place_in(self.case.skill, ((frame.filename, frame.lineno or 0) for frame in trace))
            raise Interrupted(f"{self} was under way{place and f', at {place}'}") from interrupt
        return Verdict(self.case.name, self.name, self.doc, "failed" if problems else "ok", problems)

    def __call__(self) -> None:
        """Return if the skill keeps the rule.

        Raises:
            NotConforming: It does not, or this cannot be found out.
        """
        verdict = self.verdict()
        if verdict.problems:
            raise NotConforming("\n".join((f"{self.doc} Not so:", *verdict.problems)))
