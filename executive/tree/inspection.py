"""Types with which control nodes, checker and diagnosis exchange facts, failures, findings and advice."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

from executive.skill import Skill
from executive.tree.failure import Reason
from executive.tree.flow import Flow
from executive.tree.keys import Child

MinTimeFunction: TypeAlias = Callable[[Child], float]
"""Function that returns a lower bound of the time in which a child can succeed [s]."""


@dataclass(frozen=True)
class NodeFinding:
    """A mistake in the mission that a control node finds.

    Attributes:
        place: Key, or name of a failure, that contains the mistake; "" for the node itself.
        code: Code of the finding.
        message: The mistake, one sentence.
        hint: Remedy, or "".
        is_warning: True if the mission can run nevertheless.
    """

    place: str | Reason
    code: str
    message: str
    hint: str = ""
    is_warning: bool = False


class NodeFacts(Protocol):
    """The checker's knowledge of a node in a mission."""

    @property
    def is_halted_by_sibling(self) -> bool:
        """True if the node is halted when a concurrent node has ended."""

    def flow(self, child: Child) -> Flow | None:
        """Return how a child may end; None if the child never runs."""

    def name(self, child: Child) -> str:
        """Return the name of a child in paths."""

    def place(self, reason: Reason, seen_from: Reason) -> str:
        """Return the place of a failure name for a message about the failure name `seen_from`: `line 12`."""

    def is_literal(self, key: str) -> bool:
        """Return True if the node gives the value of a key literally, not through a param or an argument."""

    def min_time(self, child: Child) -> float:
        """Return a lower bound of the time in which a child can succeed [s]."""

    def skill_times(self, child: Child) -> Sequence[tuple[str, float]]:
        """Return the names and minimum times [s] of the skills in and below a child."""

    def skills(self) -> Sequence[type[Skill] | None]:
        """Return the skills below the node; None stands for a skill that is not installed."""


@dataclass(frozen=True)
class PropagatedFailure:
    """A failure that ended a run, at a control node that it passed or in which it began.

    Attributes:
        child: The child that passed the failure on; None if the failure began in the node.
        reason: Name of the failure: `Grasp.missed`.
        names: All names of the failure at this node: `Skill.reason`, and one `label.reason` per label.
        handled: Number of failures that the node handled before, by name.
        messages: The last message of each handled failure, by name.
        last: Name of the failure that the node handled last, or "".
        choice: Last decision of the node.
        duration: Time from the start of the node to its end [s].
        has_failed: Returns True if a child ran and failed in this activation of the node.
    """

    child: Child | None
    reason: str
    names: frozenset[Reason]
    handled: Mapping[str, int]
    messages: Mapping[str, str]
    last: str
    choice: str
    duration: float
    has_failed: Callable[[Child], bool]

    def is_one_of(self, reasons: Sequence[Reason]) -> bool:
        """Return True if one of the names denotes the failure."""
        return any(Reason(name.source, name.reason) in self.names for name in reasons)


@dataclass(frozen=True)
class Advice:
    """A change of the mission after which a failure would not end the run.

    Attributes:
        text: Description of the change, without its place, which the message adds.
        key: Key to change, or "".
        child: Child to change; None for the node itself.
    """

    text: str
    key: str = ""
    child: Child | None = None


def format_reasons(reasons: Sequence[Reason]) -> str:
    """Return names of failures as a text: `Grasp.missed, look.unsure`."""
    return ", ".join(map(str, reasons))
