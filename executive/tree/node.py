"""Base class of the control nodes of a tree.

A control node is a class that an entry point registers. The class declares its keys in the
mission file, and implements `start` and `step` for the run, `compute_flow` for the checker, and `explain`
for the diagnosis.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import ClassVar

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.errors import Fault
from executive.events import BranchChosen, NodeEnded, NodeStarted
from executive.tree.flow import Flow, FlowFunction, FlowState
from executive.tree.inspection import Advice, Counterpart, NodeAnalysis, NodeFinding, PropagatedFailure
from executive.tree.keys import Child, KeyKind, KeyOwner, KeySection
from executive.tree.tree_node import Failure, NodeContext, TreeNode, halt


class ControlNode(KeyOwner, TreeNode):
    """Base class of control nodes.

    Attributes:
        keyword: Name of the node in missions, and source of the failures that the node itself causes.
        reasons: Declared reasons of the failures that the node itself causes.
        symbol: Character before the name of the node in drawings.
        remedy: Beginning of the advice to handle a failure with this node, such as `add a retry around`; the
            name of the failing node is appended. "" if this node handles no failures.
        is_condition: True if the node counts as a condition; its keys must then accept only conditions.
        clock: Clock of the run.
        ledger: Ledger of the run.
    """

    keyword: ClassVar[str] = ""
    reasons: ClassVar[tuple[str, ...]] = ()
    symbol: ClassVar[str] = "◇"
    remedy: ClassVar[str] = ""
    is_condition: ClassVar[bool] = False

    def __init__(self, context: NodeContext, **values: object) -> None:
        super().__init__(context, self.keyword)
        self.clock, self.ledger = context.clock, context.ledger
        self.set_key_values(values)
        self.children = [child for key in self.keys for child in self.list_children(key)]
        for child in self.children:
            child.parent = self

    def list_children(self, key_name: str) -> list[Child]:
        """Return the nodes under a key, including those in the sections of the key."""
        return _find_nodes(getattr(self, self.keys[key_name].attribute))

    @property
    def detail(self) -> str:
        """The constants of the node that differ from their defaults, as a text for drawings of the tree."""
        constants = [key for key in self.keys.values() if key.kind is KeyKind.CONSTANT]
        values = [(key, getattr(self, key.attribute)) for key in constants]
        return ", ".join(f"{key.name}: {value}" for key, value in values if value != key.default)

    def describe_trigger(self, child: Child) -> str:
        """Return the failures that trigger a child: `on Grasp.missed`; "" if no failure triggers it."""
        return ""

    # Methods for the run.

    def start(self) -> None:
        """Begin an activation: the ticks from the start of the node to its end."""

    def step(self) -> Status:
        """Continue by one tick; return RUNNING, SUCCESS, or FAILURE after a call of `fail`."""
        raise NotImplementedError

    def clean_up(self) -> None:
        """End an activation; called once per activation, also after a halt or a fault."""

    # Methods for the checker.

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the outcomes that are possible from a state; `get_flow` returns the outcomes of a child."""
        raise NotImplementedError

    def check(self, analysis: NodeAnalysis) -> Iterator[NodeFinding]:
        """Yield mistakes in the use of this control node in the mission."""
        yield from ()

    @property
    def unreachable_reason(self) -> str:
        """Reason why a child never runs; "" if another finding explains this."""
        return ""

    @property
    def first_child(self) -> Child | None:
        """The child that runs first in each activation of the node; None if unknown."""
        return None

    @property
    def concurrent_children(self) -> tuple[Child, ...]:
        """Children that run at the same time; empty if the children run one after the other."""
        return ()

    @property
    def children_halted_by_sibling(self) -> tuple[Child, ...]:
        """Children that the node halts when another child ends. These children may contain endless loops."""
        return ()

    # Methods for the diagnosis.

    def explain(self, failure: PropagatedFailure) -> str:
        """Return a text that explains why the node passed a failure on; "" if it passes on all failures."""
        return ""

    def count_attempts(self, failure: PropagatedFailure) -> tuple[int, int] | None:
        """Return the number of the failed attempt and the maximum number; None if the node never retries."""
        return None

    def advise(self, failure: PropagatedFailure) -> Iterator[Advice]:
        """Yield changes of the mission after which this node would handle a failure."""
        yield from ()

    def list_contingencies(self) -> Iterator[tuple[str, Child]]:
        """Yield (name in reports, child) for each child that runs only after a failure, or in `finally`."""
        yield from ()

    # Property for the export.

    @property
    def counterpart(self) -> Counterpart | None:
        """Node of BehaviorTree.CPP with the same semantics; None if there is none."""
        return None

    # Methods that subclasses call.

    def tick_child(self, child: Child) -> Status:
        """Tick a child and return its status."""
        child.tick_once()
        status = child.status
        if status is Status.INVALID:
            raise self._make_status_fault(child)
        return status

    def _make_status_fault(self, child: Child) -> Fault:
        return Fault(f"{child.name} was ticked but has no status", self.path)

    def halt_children(self, children: Iterable[Child]) -> None:
        """Halt the children and all running nodes below the children, one child after the other.

        Raises:
            Fault: The clean-up of a node failed; all other nodes were halted nevertheless.
        """
        if problems := [problem for child in children for problem in halt(child)]:
            raise Fault("; ".join(problems), self.path)

    def get_failure(self, child: Child) -> Failure:
        """Return the failure of a child; the reason is `failed` for a behaviour that is no `TreeNode`."""
        failure = getattr(child, "failure", None)
        if isinstance(failure, Failure):
            return failure
        return Failure("failed", child.feedback_message, child.name, self.path)

    def fail(self, failure: Failure) -> Status:
        """End with a failure: set `failure` with the label of this node, and return FAILURE."""
        self.failure = failure.with_label(self.label)
        return Status.FAILURE

    def fail_with_reason(self, reason: str, message: str) -> Status:
        """End with a failure of this node, with one of the declared `reasons`, and return FAILURE."""
        return self.fail(Failure(reason, message, self.keyword, self.path))

    def report_choice(self, choice: str, cause: Failure | None = None) -> None:
        """Emit an event with a decision of the node, and with the failure that caused the decision."""
        reason, message = (str(cause), cause.message) if cause else ("", "")
        self.emit(BranchChosen(self.path, choice, reason, message))

    # Methods of the py_trees interface.

    def tick(self) -> Iterator[Behaviour]:
        """Continue by one tick, then yield the ticked nodes for visitors of py_trees, children first."""
        visited_nodes: list[Behaviour] = []

        def tick_and_visit(child: Child) -> Status:
            visited_nodes.extend(child.tick())
            if child.status is Status.INVALID:
                raise self._make_status_fault(child)
            return child.status

        # An attribute of the instance hides the method, so that a tick without visitors has no extra cost.
        self.tick_child = tick_and_visit  # type: ignore[method-assign]
        try:
            self.tick_once()
        finally:
            del self.tick_child
        yield from visited_nodes
        yield self

    def tick_once(self) -> None:
        """Start the node, or continue the node by one tick."""
        if self.status is not Status.RUNNING:
            self.failure = None
            self.status = Status.RUNNING
            self.emit(NodeStarted(self.path))
            self.start()
        status = self.step()
        if status is not Status.RUNNING:
            self._end(status)

    def stop(self, new_status: Status = Status.INVALID) -> None:
        """Halt the running nodes below this node, then end with `new_status`.

        Raises:
            Fault: The clean-up of a node below failed; all other nodes were halted nevertheless.
        """
        was_running = self.status is Status.RUNNING
        try:
            self.halt_children(self.children)
        finally:
            self.status = new_status
            if was_running:
                self.clean_up()
                self.emit(NodeEnded(self.path, new_status.value))

    def _end(self, status: Status) -> None:
        """Set the final status, clean up, and emit `NodeEnded`."""
        self.status = status
        self.clean_up()
        failure = self.failure if status is Status.FAILURE else None
        reason, message, origin = (str(failure), failure.message, failure.path) if failure else ("", "", "")
        self.emit(NodeEnded(self.path, status.value, reason=reason, message=message, origin=origin))


def _find_nodes(value: object) -> list[Child]:
    """Return all nodes in the value of a key, which is a node, a list, a section or a constant."""
    if isinstance(value, KeySection):
        return [node for key in value.keys.values() for node in _find_nodes(getattr(value, key.attribute))]
    if isinstance(value, tuple):
        return [node for item in value for node in _find_nodes(item)]
    return [value] if isinstance(value, Behaviour) else []
