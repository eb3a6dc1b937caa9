"""Children of a sequence or fallback without memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from py_trees.common import Status

from executive.events import Emit
from executive.tree.event_gate import EventGate
from executive.tree.flow import Flow, FlowState
from executive.tree.inspection import NodeAnalysis, NodeFinding
from executive.tree.keys import Child, Children


class ReactiveChildren:
    """Children that every tick runs again from the first child, until a child decides the status of the tick.

    The semantics are those of ReactiveSequence and ReactiveFallback of BehaviorTree.CPP 4. A child that runs
    again and ends as before emits no events.

    Args:
        children: The children, in order.
        emit: Function that emits the events of the children.
    """

    def __init__(self, children: Children, emit: Emit) -> None:
        self._children = children
        self._gates = [EventGate(child, emit) for child in children]

    def start(self) -> None:
        """Begin an activation of the node: let the events of the next run of each child pass."""
        for gate in self._gates:
            gate.forget()

    def tick(self, tick_child: Callable[[Child], Status], continues_after: Status) -> tuple[int, Status]:
        """Tick the children in order, and return the index and the status of the last ticked child.

        A child with the status `continues_after` is followed by the next child in the same tick.
        """
        for index, gate in enumerate(self._gates):
            status = gate.tick(tick_child)
            if status is not continues_after:
                return index, status
        return len(self._gates) - 1, continues_after

    def list_running_except(self, index: int) -> list[Child]:
        """Return the running children except the child at `index`; the node must halt them."""
        others = (child for number, child in enumerate(self._children) if number != index)
        return [child for child in others if child.status is Status.RUNNING]


def compute_reactive_flow(compute_flow: Callable[[FlowState], Flow], state: FlowState) -> Flow:
    """Return the outcomes of a node whose children run again in every tick.

    `compute_flow` returns the outcomes of one pass through the children. A pass starts in `state`, or in a
    state in which a child of an earlier pass was running.
    """
    while True:
        flow = compute_flow(state)
        joined_state = state.join(flow.halted or state)
        if joined_state == state:
            return flow
        state = joined_state


def check_reactive_children(children: Children, analysis: NodeAnalysis) -> Iterator[NodeFinding]:
    """Yield a warning for each further child that takes time, and for each action that is repeated."""
    flows = [analysis.get_flow(child) for child in children]
    slow_indices = [index for index, flow in enumerate(flows) if flow is not None and flow.halted is not None]
    names = [analysis.get_name(child) for child in children]
    for index in slow_indices[1:]:
        message = (
            f"{names[index]} takes time, and so does {names[slow_indices[0]]}: without memory, every tick "
            f"runs {names[slow_indices[0]]} again, which halts {names[index]}"
        )
        hint = "Only one child may take time: put these nodes into a list, which is one child."
        yield NodeFinding(children[index], "two-running", message, hint, is_warning=True)
    if not slow_indices:
        message = "without memory, this node does the same as with memory: no child takes time"
        yield NodeFinding("memory", "useless-reactive", message, is_warning=True)
    for index in range(slow_indices[0] if len(slow_indices) == 1 else 0):
        skills = analysis.list_skills(children[index]).items()
        if actions := [name for name, skill in skills if skill is not None and not skill.is_condition]:
            message = (
                f"{actions[0]} is no condition, but runs again at every tick of {names[slow_indices[0]]}"
            )
            hint = "Put it before this node, or use a condition."
            yield NodeFinding(children[index], "repeated-action", message, hint, is_warning=True)
