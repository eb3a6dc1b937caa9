"""Base classes of control nodes, the types of their methods, and the registry of installed control nodes.

A control node is a class that an entry point registers: a pydantic model whose fields are the keys in the
mission file. Its methods need no run: `compute_flow` for the checker, `explain` for the diagnosis. Its inner
class `Behaviour` runs the node: `start` and `step`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import ClassVar, TypeAlias

from executive.behaviours import Skills
from executive.errors import InputError
from executive.plugins import PluginEntry, list_entries
from executive.skill import Skill
from executive.text.findings import Finding
from executive.tree.flow import Flow, FlowFunction, FlowState
from executive.tree.keys import KeyOwner
from executive.tree.specification import Node, Reason, SkillNode
from executive.tree.tree_node import NodeBehaviour as NodeBehaviour


@dataclass(frozen=True)
class NodeAnalysis:
    """Static analysis of a control node in a mission and of the children of the node.

    Attributes:
        flows: Possible outcomes of each node that may run, by path.
        skills: Installed skills by name.
        compute_flow: Returns the possible outcomes of a child that starts in a state; if the last argument is
            True, only outcomes in the first tick of the child are possible.
        is_halted_by_sibling: True if the node is halted when a concurrent node ends.
        is_concurrent: True if another node may run at the same time.
    """

    flows: Mapping[str, Flow]
    skills: Skills
    compute_flow: Callable[[Node, FlowState, bool], Flow]
    is_halted_by_sibling: bool
    is_concurrent: bool

    def get_flow(self, child: Node) -> Flow | None:
        """Return the possible outcomes of a child; None if the child never runs."""
        return self.flows.get(child.path)

    def list_skills(self, node: Node) -> Mapping[str, type[Skill] | None]:
        """Return the class of each skill in and below a node, by name; None if not installed."""
        names = [node.skill for node in node.walk() if isinstance(node, SkillNode)]
        return {name: self.skills.get(name) for name in names}


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

    child: Node | None
    name: str
    reasons: frozenset[Reason]
    handled_counts: Mapping[str, int]
    last_messages: Mapping[str, str]
    last_handled_name: str
    last_choice: str
    duration: float

    def matches(self, reasons: Sequence[Reason]) -> bool:
        """Return True if one of `reasons` denotes the failure."""
        return any(reason in self.reasons for reason in reasons)


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


class ControlNode(KeyOwner, Node):
    """Base class of control nodes: the specification of a node in a mission.

    Attributes:
        keyword: Name of the node in missions, and source of the failures that the node itself causes.
        reasons: Declared reasons of the failures that the node itself causes.
        symbol: Character before the name of the node in drawings.
        remedy: Beginning of the advice to handle a failure with this node, such as `add a retry around`; the
            name of the failing node is appended. "" if this node handles no failures.
        ends_mission: True if the mission succeeds when the node runs.
        is_condition: True if the node counts as a condition; its keys must then accept only conditions.
        unreachable_reason: Reason why a child never runs, if each node of the class has the same reason.
        Behaviour: Class that runs the node.
    """

    keyword: ClassVar[str] = ""
    reasons: ClassVar[tuple[str, ...]] = ()
    symbol: ClassVar[str] = "◇"
    remedy: ClassVar[str] = ""
    ends_mission: ClassVar[bool] = False
    is_condition: ClassVar[bool] = False
    unreachable_reason: ClassVar[str] = ""
    Behaviour: ClassVar[type[NodeBehaviour]]

    @property
    def type_name(self) -> str:
        """Keyword of the control node."""
        return self.keyword

    @cached_property
    def children(self) -> Sequence[Node]:
        """The nodes in the values of the keys and in sections."""
        return self.list_children()

    @property
    def own_reasons(self) -> tuple[str, ...]:
        """Reasons of the failures that this node itself causes."""
        return self.reasons

    @property
    def detail(self) -> str:
        """The constants of the node that differ from their defaults, as a text for drawings of the tree."""
        constants = [key for key in self.keys.values() if key.is_constant]
        values = [(key, getattr(self, key.attribute)) for key in constants]
        return ", ".join(f"{key.name}: {value}" for key, value in values if value != key.field.default)

    def describe_trigger(self, child: Node) -> str:
        """Return the failures that trigger a child: `on Grasp.missed`; "" if no failure triggers it."""
        return ""

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the outcomes that are possible from a state; `get_flow` returns the outcomes of a child."""
        raise NotImplementedError

    def check(self, analysis: NodeAnalysis) -> Iterator[Finding]:
        """Yield mistakes in the use of this control node in the mission."""
        yield from ()

    def explain_unreachable(self) -> str:
        """Return the reason why a child never runs; "" if another finding explains this."""
        return self.unreachable_reason

    @property
    def first_child(self) -> Node | None:
        """The child that runs first in each activation of the node; None if unknown."""
        return None

    @property
    def concurrent_children(self) -> tuple[Node, ...]:
        """Children that run at the same time; empty if the children run one after the other."""
        return ()

    @property
    def children_halted_by_sibling(self) -> tuple[Node, ...]:
        """Children that the node halts when another child ends. These children may contain endless loops."""
        return ()

    def explain(self, failure: PropagatedFailure) -> str:
        """Return a text that explains why the node passed a failure on; "" if it passes on all failures."""
        return ""

    def count_attempts(self, failure: PropagatedFailure) -> tuple[int, int] | None:
        """Return the number of the failed attempt and the maximum number; None if the node never retries."""
        return None

    def advise(self, failure: PropagatedFailure) -> Iterator[tuple[str, Node]]:
        """Yield changes of the mission after which this node would handle a failure.

        Each change is a text without the line number, and the node that the author should change.
        """
        yield from ()

    def list_contingencies(self) -> Iterator[tuple[str, Node]]:
        """Yield (name in reports, child) for each child that runs only after a failure, or in `finally`."""
        yield from ()

    @property
    def counterpart(self) -> Counterpart | None:
        """Node of BehaviorTree.CPP with the same semantics; None if there is none."""
        return None


ENTRY_POINT_GROUP = "executive.control_nodes"
"""Group of the entry points of control nodes."""

ControlNodes: TypeAlias = Mapping[str, type[ControlNode]]
"""Classes of control nodes by keyword."""

_KEYWORD_PATTERN = re.compile("[a-z][a-z0-9_]*")
"""Pattern of keywords: a lower-case identifier."""


def load_control_nodes() -> ControlNodes:
    """Return the class of every installed control node by its keyword.

    Raises:
        InputError: Two packages register the same keyword, or a class cannot be loaded or is incomplete.
    """
    return _load_classes(tuple(list_entries(ENTRY_POINT_GROUP, "control node").values()))


@cache
def _load_classes(entries: tuple[PluginEntry, ...]) -> ControlNodes:
    node_classes = {entry.name: entry.load() for entry in entries}
    for entry in entries:
        if problem := _find_problem(entry.name, node_classes[entry.name]):
            raise InputError(f'the entry point "{entry.name}" ({entry.value}) {problem}')
    return node_classes


def _find_problem(keyword: str, node_class: object) -> str:
    """Return an error message if `node_class` cannot be used as a control node, else ""."""
    if not (isinstance(node_class, type) and issubclass(node_class, ControlNode)):
        return "is not a ControlNode subclass"
    class_keyword = node_class.keyword
    if not _KEYWORD_PATTERN.fullmatch(keyword) or class_keyword != keyword:
        return f'must have the keyword of its class as its name, in lower case: "{class_keyword}"'
    if node_class.compute_flow is ControlNode.compute_flow:
        return "has no method compute_flow"
    if getattr(node_class, "Behaviour", NodeBehaviour).step is NodeBehaviour.step:
        return "has no inner class Behaviour with a method step"
    for key in node_class.keys.values():
        # The key `as` is reserved for the label of a node.
        if (
            key.name == "as"
            or key.attribute in ControlNode.model_fields
            or hasattr(ControlNode, key.attribute)
        ):
            return f'cannot have the key "{key.name}": the name is reserved'
    return ""
