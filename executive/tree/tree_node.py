"""Ticks and halts of the nodes of a tree: base classes of all nodes and of control nodes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.errors import Fault, Interrupted, describe_error
from executive.events import BranchChosen, Event, NodeEnded, NodeStarted
from executive.tree.blackboard import Failure, NodeContext
from executive.tree.expression import Scope
from executive.tree.specification import Expression, Node


class TreeNode(Behaviour):
    """Base class of control nodes and skill leaves: a py_trees behaviour with a method `tick_once`.

    Attributes:
        path: Unique path from the root of the tree.
        label: Label of the node in the mission, or "".
        blackboard: Variables of the run.
        failure: The failure while the status is FAILURE; else None. `feedback_message` contains its text.
        subtree_names: Names of the subtrees with this node as root, the outermost first.
    """

    subtree_names: tuple[str, ...] = ()

    def __init__(self, context: NodeContext, name: str) -> None:
        super().__init__(context.label or name)
        self.path = context.path
        self.label = context.label
        self.blackboard = context.blackboard
        self.failure: Failure | None = None
        self._emit_without_parent = context.emit
        self._held_events: list[Event] | None = None
        """Events of this node and of the nodes below that wait for their emission; None outside of a hold."""

    def _begin(self) -> None:
        """Set the status RUNNING, and remove the failure of the previous activation."""
        self.failure = None
        self.feedback_message = ""
        self.status = Status.RUNNING

    def fail(self, failure: Failure) -> Status:
        """End with a failure: set `failure` with the label of this node, and return FAILURE."""
        self.failure = failure.with_label(self.label)
        self.feedback_message = f"{failure}: {failure.message}"
        return Status.FAILURE

    def emit(self, event: Event) -> None:
        """Emit an event of this node or of a node below, unless this node or an ancestor holds its events."""
        node: TreeNode = self
        while node._held_events is None and isinstance(node.parent, TreeNode):
            node = node.parent
        if node._held_events is None:
            node._emit_without_parent(event)
        else:
            node._held_events.append(event)

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
            except Interrupted:
                raise
            except BaseException as error:
                node_name = (error.node if isinstance(error, Fault) else "") or node.name
                problems.append(f"{node_name}: {describe_error(error)}")
                # A node whose clean-up failed counts as ended: no node is halted twice.
                node.status = Status.INVALID
    return problems


class NodeBehaviour(TreeNode):
    """Base class of the behaviours of control nodes; a subclass implements `start` and `step`.

    Attributes:
        node: Specification of the node.
        behaviour_by_child: Behaviour of each child of the specification.
        clock: Clock of the run.
        ledger: Ledger of the run.
        scope: What the expressions of the node can read.
    """

    def __init__(self, context: NodeContext, node: Node, build_child: Callable[[Node], Behaviour]) -> None:
        super().__init__(context, node.type_name)
        self.node = node
        self.behaviour_by_child = {child: build_child(child) for child in node.children}
        self.clock = context.clock
        self.ledger = context.ledger
        self.scope = Scope(context.blackboard, context.ledger, context.clock)
        self.children = list(self.behaviour_by_child.values())
        self._awaited: dict[Node, Status | None] = {}
        """Children of `await_child`, each with its status in the current tick; None before its tick."""
        self._visited_nodes: list[Behaviour] | None = None
        """Nodes that were ticked in this tick, for visitors of py_trees; None in a tick without visitors."""
        for child in self.children:
            child.parent = self

    @property
    def detail(self) -> str:
        """The constants of the node, as a text for drawings of the tree."""
        return self.node.detail

    def start(self) -> None:
        """Begin an activation: the ticks from the start of the node to its end."""

    def step(self) -> Status:
        """Continue by one tick; return RUNNING, SUCCESS, or FAILURE after a call of `fail`."""
        raise NotImplementedError

    def clean_up(self) -> None:
        """End an activation; called once per activation, also after a halt or a fault."""

    def read_value(self, key: str) -> object:
        """Return the value of a plain key of the node, or the present value of its expression."""
        value = getattr(self.node, "settings", {}).get(key)
        return self.scope.evaluate(value) if isinstance(value, Expression) else getattr(self.node, key)

    def tick_child(self, child: Node) -> Status:
        """Tick a child and return its status."""
        behaviour = self.behaviour_by_child[child]
        if self._visited_nodes is None:
            behaviour.tick_once()
        else:
            self._visited_nodes.extend(behaviour.tick())
        status = behaviour.status
        if status is Status.INVALID:
            raise Fault(f"{behaviour.name} was ticked but has no status", self.path)
        return status

    def await_child(self, child: Node) -> Status:
        """Tick a child and return its status; `step` is not called while all awaited children are running.

        When one of them has ended, `step` must call this method again for each of them, in the same order.
        """
        status = self._awaited.pop(child, None) or self.tick_child(child)
        if status is Status.RUNNING:
            self._awaited[child] = None
        return status

    def halt_children(self, children: Iterable[Node]) -> None:
        """Halt the children and all running nodes below the children, one child after the other.

        Raises:
            Fault: The clean-up of a node failed; all other nodes were halted nevertheless.
        """
        problems = [problem for child in children for problem in halt(self.behaviour_by_child[child])]
        if problems:
            raise Fault("; ".join(problems), self.path)

    def get_failure(self, child: Node) -> Failure:
        """Return the failure of a child; the reason is `failed` for a behaviour that is no `TreeNode`."""
        behaviour = self.behaviour_by_child[child]
        failure = getattr(behaviour, "failure", None)
        if isinstance(failure, Failure):
            return failure
        return Failure(behaviour.name, "failed", self.path, message=behaviour.feedback_message)

    def fail_with_reason(self, reason: str, message: str) -> Status:
        """End with a failure of this node, with one of the declared `reasons`, and return FAILURE."""
        return self.fail(Failure(self.node.type_name, reason, self.path, message=message))

    def report_choice(self, choice: str, cause: Failure | None = None) -> None:
        """Emit an event with a decision of the node, and with the failure that caused the decision."""
        reason, message = (str(cause), cause.message) if cause else ("", "")
        self.emit(BranchChosen(self.path, choice, reason, message))

    def tick(self) -> Iterator[Behaviour]:
        """Continue by one tick, then yield the ticked nodes for visitors of py_trees, children first."""
        visited_nodes = self._visited_nodes = []
        try:
            self.tick_once()
        finally:
            self._visited_nodes = None
        yield from visited_nodes
        yield self

    def tick_once(self) -> None:
        """Start the node, or continue the node by one tick."""
        if self.status is not Status.RUNNING:
            self._begin()
            self._awaited.clear()
            self.emit(NodeStarted(self.path))
            self.start()
        elif self._awaited and self._tick_awaited_children():
            return
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
            self.halt_children(self.node.children)
        finally:
            self.status = new_status
            if was_running:
                self.clean_up()
                self.emit(NodeEnded(self.path, new_status.value))

    def _tick_awaited_children(self) -> bool:
        """Tick the awaited children in order until one of them ends; return True if all are running."""
        for child in self._awaited:
            status = self._awaited[child] = self.tick_child(child)
            if status is not Status.RUNNING:
                return False
        self._awaited = dict.fromkeys(self._awaited)
        return True

    def _end(self, status: Status) -> None:
        """Set the final status, clean up, and emit `NodeEnded`."""
        self.status = status
        self.clean_up()
        failure = self.failure if status is Status.FAILURE else None
        reason, message, origin = (str(failure), failure.message, failure.path) if failure else ("", "", "")
        self.emit(NodeEnded(self.path, status.value, reason=reason, message=message, origin=origin))
