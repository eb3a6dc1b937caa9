"""Types that the checker, the diagnosis and the export exchange with control nodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, TypeAlias

from executive.skill import Skill
from executive.tree.flow import Flow, FlowState
from executive.tree.keys import Child
from executive.tree.specification import Reason

MinTimeFunction: TypeAlias = Callable[[Child], float]
"""Type in signatures of `min_time`, which nodes of third parties may still define; nothing calls it."""


@dataclass(frozen=True)
class NodeFinding:
    """A mistake in the mission that a control node finds.

    Attributes:
        place: Place of the mistake: a key of the node, a reason under a key, or a child; "" for the node
            itself.
        code: Code of the finding, such as `endless`.
        message: Description of the mistake, one sentence.
        hint: Description of a remedy, or "".
        is_warning: True if the mission can run nevertheless.
    """

    place: str | Reason | Child
    code: str
    message: str
    hint: str = ""
    is_warning: bool = False


class NodeAnalysis(Protocol):
    """Static analysis of a control node in a mission and of the children of the node.

    Attributes:
        is_halted_by_sibling: True if the node is halted when a concurrent node ends.
        is_concurrent: True if another node may run at the same time.
    """

    is_halted_by_sibling: bool
    is_concurrent: bool

    def get_flow(self, child: Child) -> Flow | None:
        """Return the possible outcomes of a child; None if the child never runs."""

    def compute_flow(self, child: Child, entry: FlowState, *, is_first_tick: bool = False) -> Flow:
        """Return the possible outcomes of a child that starts in a state.

        If `is_first_tick` is True, only outcomes in the first tick of the child are possible.
        """

    def get_name(self, child: Child) -> str:
        """Return the last part of the path of a child: its label, or its skill, subtree or keyword."""

    def describe_place(self, reason: Reason, relative_to: Reason) -> str:
        """Return the line of `reason` as a text, with the file if `relative_to` is in another file."""

    def is_written_as_constant(self, key: str) -> bool:
        """Return True if the value of a key is written at the node itself, not in a param or an argument."""

    def list_skills(self, child: Child | None = None) -> Mapping[str, type[Skill] | None]:
        """Return the class of each skill in the subtree of `child`, by name; None if not installed.

        If `child` is None, the skills are those in the subtree of the node itself.
        """


@dataclass(frozen=True)
class PropagatedFailure:
    """A failure that ended a run, as seen by a control node that caused the failure or passed it on.

    Attributes:
        child: The child that passed the failure on; None if the node itself caused the failure.
        name: Name of the failure: `Grasp.missed`.
        reasons: Reasons that denote the failure: `Skill.reason`, and `label.reason` for each label.
        handled_counts: Number of earlier failures that the node handled, by name of the failure.
        last_messages: Last message of each handled failure, by name of the failure.
        last_handled_name: Name of the failure that the node handled last, or "".
        last_choice: Last decision of the node as a text: `attempt 2 of 3`.
        duration: Time from the start of the node to its end [s].
    """

    child: Child | None
    name: str
    reasons: frozenset[Reason]
    handled_counts: Mapping[str, int]
    last_messages: Mapping[str, str]
    last_handled_name: str
    last_choice: str
    duration: float

    def matches(self, reasons: Sequence[Reason]) -> bool:
        """Return True if one of `reasons` denotes the failure."""
        # A `LocatedReason` of the checker is a `Reason` with a position, and equals no plain `Reason`.
        return any(Reason(reason.source, reason.reason) in self.reasons for reason in reasons)


@dataclass(frozen=True)
class Advice:
    """A change of the mission after which a failure would not end the run.

    Attributes:
        text: Description of the change without the line number, which the diagnosis adds.
        child: Child that the author should change; None for the node itself.
    """

    text: str
    child: Child | None = None


@dataclass(frozen=True)
class Counterpart:
    """Node type that BehaviorTree.CPP 4 registers, with the semantics of a control node.

    Attributes:
        name: Name of the node type.
        ports: By port, a number, or the name of the key whose value the port gets. The mission must set
            that key.
    """

    name: str
    ports: Mapping[str, str | int] = field(default_factory=dict)
