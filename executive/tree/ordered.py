"""Base class of the control nodes that run their children in order: sequence and fallback."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

from py_trees.common import Status

from executive.tree.flow import UNKNOWN_STATE, Flow, FlowFunction, FlowState, join_states
from executive.tree.inspection import Counterpart, NodeAnalysis, NodeFinding
from executive.tree.keys import Child, Children, key
from executive.tree.reactive_node import ReactiveNode


class OrderedNode(ReactiveNode):
    """Run the children in order until a child returns another status than `continue_status`.

    Without memory, every tick begins with the first child. A child that runs again and ends as before emits
    no events. The semantics are those of ReactiveSequence and ReactiveFallback of BehaviorTree.CPP 4.

    Attributes:
        continue_status: Status of a child after which the next child is ticked in the same tick.
    """

    continue_status: ClassVar[Status]

    memory: bool = key(
        default=True,
        doc="False to run all children again in every tick, from the first to the running child.",
    )
    do: Children

    def start(self) -> None:
        """Begin with the first child."""
        super().start()
        self._child_index = 0

    def step(self) -> Status:
        """Tick the children in order until one of them decides the status of the tick."""
        index = previous_index = self._child_index
        tick = self.tick_child
        if not self.memory:
            index, tick = 0, self.tick_again
        status = tick(self.do[index])
        if status is Status.RUNNING and index == previous_index:
            return status
        while status is self.continue_status and index + 1 < len(self.do):
            index += 1
            if index > previous_index:
                self.on_child_change(index)
            status = tick(self.do[index])
        if index < previous_index:
            self.halt_children([self.do[previous_index]])
            self.on_child_change(index)
        self._child_index = index
        return self.fail(self.get_failure(self.do[index])) if status is Status.FAILURE else status

    def on_child_change(self, index: int) -> None:
        """Called when the node moves to a later or earlier child; a fallback reports this decision."""

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the possible outcomes.

        Without memory, each tick begins with the first child, even while a later child is running. Therefore,
        the states in which a child is running (`halted`) are entry states of the first child, too.
        """
        while True:
            flow = self._compute_pass(get_flow, state)
            joined_state = state if self.memory else state.join(flow.halted or state)
            if joined_state == state:
                return flow
            state = joined_state

    def _compute_pass(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the possible outcomes of one pass through the children."""
        flows: list[Flow] = []
        entry: FlowState | None = state
        for child in self.do:
            if entry is None:
                break
            flows.append(get_flow(child, entry))
            entry = self._compute_next_entry(flows[-1])
        # A sequence ends with the first failure; a fallback ends with the first success or the last failure.
        is_sequence = self.continue_status is Status.SUCCESS
        success = entry if is_sequence else join_states(flow.success for flow in flows)
        last_flows = flows if is_sequence else flows[-1:]
        failures = {failure: end for flow in last_flows for failure, end in flow.failures.items()}
        return Flow(success, failures, join_states(flow.halted for flow in flows))

    def _compute_next_entry(self, flow: Flow) -> FlowState | None:
        """Return the entry state of the next child; None if the child never ends with `continue_status`."""
        if self.continue_status is Status.SUCCESS:
            return flow.success
        return join_states(end.with_handled_failure(failure) for failure, end in flow.failures.items())

    def check(self, analysis: NodeAnalysis) -> Iterator[NodeFinding]:
        """Yield a warning if `memory: false` has no effect, halts a child, or repeats an action."""
        if self.memory:
            return
        flows = {child: analysis.get_flow(child) for child in self.do}
        slow = [child for child, flow in flows.items() if flow and flow.halted is not None]
        if not slow or slow == [self.do[0]]:
            message = "`memory: false` has no effect: no child after the first takes time"
            yield NodeFinding("memory", "useless-reactive", message, is_warning=True)
            return
        # `blocker` is the first slow child that cannot end with `continue_status` in its first tick; if there
        # is none, the last slow child. Each tick of `blocker` halts a running child after it.
        blocker = next((child for child in slow if not self._may_continue_at_once(child, analysis)), slow[-1])
        name = analysis.get_name(blocker)
        for child in slow[slow.index(blocker) + 1 :]:
            message = (
                f"{analysis.get_name(child)} takes time, and so does {name}: without memory, every tick "
                f"runs {name} again, which halts {analysis.get_name(child)}"
            )
            hint = "Only one child may take time: combine these nodes into one child (a list)."
            yield NodeFinding(child, "two-running", message, hint, is_warning=True)
        for child in self.do[: self.do.index(blocker)]:
            skills = analysis.list_skills(child).items() if child not in slow else ()
            if actions := [name for name, skill in skills if skill is not None and not skill.is_condition]:
                message = f"{actions[0]} is not a condition, but runs again at every tick of {name}"
                hint = "Put the action before this node, or use a condition."
                yield NodeFinding(child, "repeated-action", message, hint, is_warning=True)

    def _may_continue_at_once(self, child: Child, analysis: NodeAnalysis) -> bool:
        """Return True if a child may end with `continue_status` in its first tick."""
        flow = analysis.compute_flow(child, UNKNOWN_STATE, is_first_tick=True)
        return self._compute_next_entry(flow) is not None

    @property
    def counterpart(self) -> Counterpart | None:
        """`Sequence` or `Fallback` of BehaviorTree.CPP; without memory, their reactive variants."""
        name = "Sequence" if self.continue_status is Status.SUCCESS else "Fallback"
        return Counterpart(name if self.memory else f"Reactive{name}")
