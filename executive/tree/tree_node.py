"""Base class of all nodes of a tree, failures, the context of a node, the blackboard, and halting."""

from __future__ import annotations

from collections import UserDict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.cell.ledger import Ledger
from executive.cell.protocols import Clock
from executive.errors import Fault
from executive.events import Emit, Event, discard_event
from executive.tree.specification import Reason


@dataclass(frozen=True)
class Failure:
    """A failure with a declared reason, which nodes pass on to their parents.

    Attributes:
        reason: One of the declared reasons of the skill or of the control node.
        message: One sentence with the measured values that explain the failure.
        source: Name of the skill, or the keyword of the control node, that failed.
        path: Path of the node that failed.
        labels: Labels of the failed node and of the ancestors that passed the failure on.
    """

    reason: str
    message: str
    source: str
    path: str
    labels: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.source}.{self.reason}"

    def matches(self, reasons: Iterable[Reason]) -> bool:
        """Return True if one of `reasons` denotes this failure."""
        sources = (self.source, *self.labels)
        return any(reason.reason == self.reason and reason.source in sources for reason in reasons)

    def with_label(self, label: str) -> Failure:
        """Return the failure with one more label, of a node that passed the failure on; "" adds no label."""
        return replace(self, labels=(*self.labels, label)) if label else self


@dataclass(frozen=True)
class NodeContext:
    """Path and label of a node, and the parts of the run that the node uses.

    Attributes:
        path: Unique path from the root of the tree.
        clock: Clock of the run.
        ledger: Ledger of the run.
        blackboard: Variables of the run.
        label: Label of the node in the mission, or "".
        emit: Function that emits the events of the node.
    """

    path: str
    clock: Clock
    ledger: Ledger
    blackboard: Blackboard
    label: str = ""
    emit: Emit = discard_event


class TreeNode(Behaviour):
    """Base class of control nodes and skill leaves: a py_trees behaviour with a method `tick_once`.

    Attributes:
        path: Unique path from the root of the tree.
        label: Label of the node in the mission, or "".
        blackboard: Variables of the run.
        subtree_names: Names of the subtrees with this node as root, the outermost first.
    """

    subtree_names: tuple[str, ...] = ()

    def __init__(self, context: NodeContext, name: str) -> None:
        super().__init__(context.label or name)
        self.path = context.path
        self.label = context.label
        self.blackboard = context.blackboard
        self._failure: Failure | None = None
        self._emit_without_parent = context.emit

    @property
    def failure(self) -> Failure | None:
        """The failure while the status is FAILURE; else None. `feedback_message` contains its text."""
        return self._failure

    @failure.setter
    def failure(self, failure: Failure | None) -> None:
        self._failure = failure
        self.feedback_message = f"{failure}: {failure.message}" if failure else ""

    def emit(self, event: Event) -> None:
        """Emit an event of this node or of a node below, through all ancestors."""
        emit = self.parent.emit if isinstance(self.parent, TreeNode) else self._emit_without_parent
        emit(event)

    def update(self) -> Status:
        """Continue by one tick and return the status."""
        self.tick_once()
        return self.status

    def tick(self) -> Iterator[Behaviour]:
        """Continue by one tick, then yield this node for visitors of py_trees."""
        self.tick_once()
        yield self


def halt(root: Behaviour) -> list[str]:
    """Stop every running node of the tree `root`, children first; return the messages of failed clean-ups."""
    problems = []
    for node in root.iterate():
        if node.status is Status.RUNNING:
            try:
                node.stop(Status.INVALID)
            except Exception as error:
                node_name = (error.node if isinstance(error, Fault) else "") or node.name
                problems.append(f"{node_name}: {error}")
                # A node whose clean-up failed counts as ended: no node is halted twice.
                node.status = Status.INVALID
    return problems


class Blackboard(UserDict[str, object]):
    """The variables of one run by name; a skill reads inputs at its start and writes outputs on success.

    Every run has its own blackboard, so that one process can execute several missions. All subtrees share
    the blackboard. Arguments of subtrees are no variables: values replace them before the tree is built.
    """

    def describe_missing(self, variable: str) -> str:
        """Return a text about a variable that a node reads too early, for the end of a sentence."""
        return f"${variable}, which no node has written yet; written so far: {', '.join(self) or 'nothing'}"
