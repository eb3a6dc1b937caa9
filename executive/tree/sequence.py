"""Control node that runs its children in order."""

from __future__ import annotations

from collections.abc import Iterator

from py_trees.common import Status

from executive.tree.counterpart import Counterpart
from executive.tree.flow import Flow, FlowFunction, FlowState, PossibleFailure, join_states
from executive.tree.inspection import MinTimeFunction, NodeAnalysis, NodeFinding
from executive.tree.keys import Child, Children, key
from executive.tree.node import ControlNode, NodeContext
from executive.tree.reactive_children import (
    ReactiveChildren,
    check_reactive_children,
    compute_reactive_flow,
)


class Sequence(ControlNode):
    """Run the children in order; fail with the first failure.

    Without memory, every tick begins with the first child again: children that have succeeded are checked
    again while a later child runs, and the later child is halted if one of them fails or takes time.

    * BehaviorTree.CPP: `Sequence`; without memory `ReactiveSequence`. Here, no child is skipped, and the
      checker reports a second child that takes time, which BehaviorTree.CPP reports in a run, if enabled.
    * py_trees: `Sequence(memory=True)`, which may be empty; without memory `Sequence(memory=False)`.
    """

    keyword = "sequence"
    symbol, shape = "→", "box"

    memory: bool = key(
        default=True,
        doc="False to run all children again in every tick, from the first to the running child.",
    )
    do: Children = key(shorthand=True, doc="Nodes to run, in order.")

    def __init__(self, context: NodeContext, **values: object) -> None:
        super().__init__(context, **values)
        self._reactive_children = None if self.memory else ReactiveChildren(self.do, context.emit)

    def start(self) -> None:
        """Begin with the first child."""
        self._child_index = 0
        if self._reactive_children is not None:
            self._reactive_children.start()

    def step(self) -> Status:
        """Tick the current child; after a success, tick the next child in the same tick."""
        if self._reactive_children is not None:
            return self._step_without_memory(self._reactive_children)
        while self._child_index < len(self.do):
            child = self.do[self._child_index]
            status = self.tick_child(child)
            if status is Status.RUNNING:
                return status
            if status is Status.FAILURE:
                return self.fail(self.get_failure(child))
            self._child_index += 1
        return Status.SUCCESS

    def _step_without_memory(self, children: ReactiveChildren) -> Status:
        index, status = children.tick(self.tick_child, continues_after=Status.SUCCESS)
        self.halt_children(children.list_running_except(index))
        return self.fail(self.get_failure(self.do[index])) if status is Status.FAILURE else status

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the outcomes; each child starts in the state after success of the previous child."""
        if not self.memory:
            return compute_reactive_flow(lambda entry: self._compute_pass(get_flow, entry), state)
        return self._compute_pass(get_flow, state)

    def _compute_pass(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the outcomes of one pass through the children."""
        failures: dict[PossibleFailure, FlowState] = {}
        halted = None
        entry: FlowState | None = state
        for child in self.do:
            if entry is None:
                break
            flow = get_flow(child, entry)
            failures.update(flow.failures)
            entry, halted = flow.success, join_states((halted, flow.halted))
        return Flow(entry, failures, halted)

    def min_time(self, get_min_time: MinTimeFunction) -> float:
        """Return the sum of the minimum times of all children [s]."""
        return sum(map(get_min_time, self.do))

    def check(self, analysis: NodeAnalysis) -> Iterator[NodeFinding]:
        """Yield mistakes in the use of a sequence without memory."""
        return iter(()) if self.memory else check_reactive_children(self.do, analysis)

    def explain_unreachable(self, child: Child) -> str:
        """Return a text that explains why `child` never runs: an earlier child cannot succeed."""
        del child
        return "an earlier child never succeeds"

    @property
    def first_child(self) -> Child | None:
        """The first child; None without memory, because later ticks read the inputs of the child again."""
        return self.do[0] if self.memory else None

    @property
    def counterpart(self) -> Counterpart | None:
        """`Sequence`, or `ReactiveSequence` without memory."""
        return Counterpart("Sequence" if self.memory else "ReactiveSequence")
