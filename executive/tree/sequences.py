"""Control nodes that tick their children in order: sequence, fallback, conditions and guard.

Without memory, and in a guard, every tick runs children again.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

from py_trees.common import Status

from executive.errors import Fault
from executive.skill import HOLDING
from executive.text.findings import Finding, make_error, make_warning
from executive.tree.flow import UNKNOWN_STATE, Flow, FlowFunction, FlowState, PossibleFailure, join_states
from executive.tree.keys import Children, KeyOwner, key
from executive.tree.node import ControlNode, Counterpart, NodeAnalysis, PropagatedFailure
from executive.tree.specification import Child, Constant, Node
from executive.tree.tree_node import NodeBehaviour

_COMPARED_ATTRIBUTES = ("node", "status", "reason", "choice", "item", "outputs")
"""Attributes of events by which two runs of a child are compared; the numbers in messages may differ."""


class ReactiveBehaviour(NodeBehaviour):
    """Base class of the control nodes that run children again in every tick.

    If a run of a child takes one tick and has the same result as the previous run, its events are discarded.
    Without this rule, a condition that is checked at every tick would fill the journal with equal events.
    """

    def start(self) -> None:
        """Forget all previous results, so that the first run of each child emits events."""
        self._last_results: dict[Node, list[tuple[object, ...]]] = {}

    def tick_again(self, child: Node) -> Status:
        """Tick a child, and return its status; discard its events if it ends as in its previous run."""
        if self.behaviour_by_child[child].status is Status.RUNNING:
            return self.tick_child(child)
        events = self._held_events = []
        status = Status.RUNNING
        try:
            status = self.tick_child(child)
        finally:
            self._held_events = None
            result = [tuple(getattr(event, name, "") for name in _COMPARED_ATTRIBUTES) for event in events]
            if status is Status.RUNNING or result != self._last_results.get(child):
                for event in events:
                    self.emit(event)
            self._last_results[child] = [] if status is Status.RUNNING else result
        return status


class OrderedNode(ControlNode):
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
        return flow.join_handled()

    def check(self, analysis: NodeAnalysis) -> Iterator[Finding]:
        """Yield a warning if `memory: false` has no effect, halts a child, or repeats an action."""
        memory = self.settings.get("memory")
        if self.memory or not isinstance(memory, Constant):
            return
        flows = {child: analysis.get_flow(child) for child in self.do}
        slow = [child for child, flow in flows.items() if flow and flow.halted is not None]
        if not slow or slow == [self.do[0]]:
            message = "`memory: false` has no effect: no child after the first takes time"
            yield make_warning(memory.span, "useless-reactive", message + memory.origin_note)
            return
        # `blocker` is the first slow child that cannot end with `continue_status` in its first tick; if there
        # is none, the last slow child. Each tick of `blocker` halts a running child after it.
        blocker = next((child for child in slow if not self._may_continue_at_once(child, analysis)), slow[-1])
        name = blocker.path_name
        for child in slow[slow.index(blocker) + 1 :]:
            message = (
                f"{child.path_name} takes time, and so does {name}: without memory, every tick "
                f"runs {name} again, which halts {child.path_name}"
            )
            hint = "Only one child may take time: combine these nodes into one child (a list)."
            yield make_warning(child.span, "two-running", message, hint)
        for child in self.do[: self.do.index(blocker)]:
            skills = analysis.list_skills(child).items() if child not in slow else ()
            if actions := [name for name, skill in skills if skill is not None and not skill.is_condition]:
                message = f"{actions[0]} is not a condition, but runs again at every tick of {name}"
                hint = "Put the action before this node, or use a condition."
                yield make_warning(child.span, "repeated-action", message, hint)

    def _may_continue_at_once(self, child: Node, analysis: NodeAnalysis) -> bool:
        """Return True if a child may end with `continue_status` in its first tick."""
        flow = analysis.compute_flow(child, UNKNOWN_STATE, True)
        return self._compute_next_entry(flow) is not None

    @property
    def counterpart(self) -> Counterpart | None:
        """`Sequence` or `Fallback` of BehaviorTree.CPP; without memory, their reactive variants."""
        name = "Sequence" if self.continue_status is Status.SUCCESS else "Fallback"
        return Counterpart(name if self.memory else f"Reactive{name}")

    class Behaviour(ReactiveBehaviour):
        """Runs the node."""

        node: OrderedNode

        def start(self) -> None:
            """Begin with the first child."""
            super().start()
            self._child_index = 0

        def step(self) -> Status:
            """Tick the children in order until one of them decides the status of the tick."""
            index = previous_index = self._child_index
            tick = self.await_child
            if not self.node.memory:
                index = 0
                tick = self.tick_again
            status = tick(self.node.do[index])
            if status is Status.RUNNING and index == previous_index:
                return status
            while status is self.node.continue_status and index + 1 < len(self.node.do):
                index += 1
                if index > previous_index:
                    self.on_child_change(index)
                status = tick(self.node.do[index])
            if index < previous_index:
                self.halt_children([self.node.do[previous_index]])
                self.on_child_change(index)
            self._child_index = index
            return self.fail(self.get_failure(self.node.do[index])) if status is Status.FAILURE else status

        def on_child_change(self, index: int) -> None:
            """Called when the node moves to a later or earlier child; a fallback reports this decision."""


class Sequence(OrderedNode):
    """Run the children in order; fail with the first failure.

    Without memory, every tick begins with the first child again: children that have succeeded are checked
    again while a later child runs, and the later child is halted if one of them fails or returns RUNNING.

    * BehaviorTree.CPP: `Sequence`; without memory `ReactiveSequence`. Here, children are never skipped.
      The checker warns if two children can return RUNNING, unless the first of them may succeed in its first
      tick. BehaviorTree.CPP makes no exception and can throw an error during the run.
    * py_trees: `Sequence(memory=True)` or `Sequence(memory=False)`. There, a sequence may be empty.
    """

    keyword = "sequence"
    symbol = "→"
    continue_status = Status.SUCCESS
    unreachable_reason = "an earlier child never succeeds"

    do: Children = key(shorthand=True, doc="Nodes to run, in order.")

    @property
    def first_child(self) -> Node | None:
        """The first child, which runs once; None without memory, because each tick runs the child again."""
        return self.do[0] if self.memory else None


class Fallback(OrderedNode):
    """Run the children in order until a child succeeds; fail with the failure of the last child.

    With memory, a child that failed is not run again. Without memory, every tick begins with the first child
    again: children that have failed are tried again while a later child runs, and the later child is halted
    if one of them succeeds or returns RUNNING.

    * BehaviorTree.CPP: `Fallback`; without memory `ReactiveFallback`. Here, children are never skipped.
      The checker warns if two children can return RUNNING, unless the first of them may fail in its first
      tick. BehaviorTree.CPP makes no exception and can throw an error during the run.
    * py_trees: `Selector(memory=True)` or `Selector(memory=False)`. There, a fallback may be empty.
    """

    keyword = "fallback"
    symbol = "?"
    continue_status = Status.FAILURE
    unreachable_reason = "an earlier child never fails"

    do: Children = key(shorthand=True, doc="Alternatives, in order.")

    def explain(self, failure: PropagatedFailure) -> str:
        """Return the cause of a failure: all children failed. The text contains the handled failures."""
        causes = ", ".join(f"{name} ({message})" for name, message in failure.last_messages.items())
        earlier_failures = f"; the earlier ones failed with {causes}" if causes else ""
        return f"all {len(self.do)} choices failed{earlier_failures}"

    def list_contingencies(self) -> Iterator[tuple[str, Node]]:
        """Yield all children except the first, with the names `choice 2`, `choice 3`, …."""
        for number, child in enumerate(self.do[1:], 2):
            yield f"choice {number}", child

    class Behaviour(OrderedNode.Behaviour):
        """Runs the node."""

        node: Fallback

        def on_child_change(self, index: int) -> None:
            """Report the number of the next child, and the failure of the child before it."""
            if index > 0:
                failure = self.get_failure(self.node.do[index - 1])
                self.report_choice(f"choice {index + 1} of {len(self.node.do)}", failure)


class ConditionList(KeyOwner):
    """Mixin of `all` and `any`, which restricts a sequence or a fallback to conditions.

    Conditions decide within one tick, so the key `memory` would have no effect.
    """

    is_condition: ClassVar[bool] = True

    do: Children = key(shorthand=True, requires_conditions=True, doc="Conditions, in order.")


class AllConditions(ConditionList, Sequence):
    """Succeed if all conditions succeed; fail with the first failure, without a check of later conditions.

    * BehaviorTree.CPP: `Sequence`.
    * py_trees: `Sequence`.
    """

    keyword = "all"
    symbol = "&"


class AnyCondition(ConditionList, Fallback):
    """Succeed with the first condition that succeeds; fail with the failure of the last condition.

    * BehaviorTree.CPP: `Fallback`.
    * py_trees: `Selector`.
    """

    keyword = "any"
    symbol = "≥1"


class Guard(ControlNode):
    """Run the body while a condition holds; when the condition fails, halt the body and fail with `broken`.

    Every tick checks the condition before it ticks the body. If the condition fails at the first tick, the
    body does not start. Otherwise, the guard returns the status of the body.

    * BehaviorTree.CPP: `ReactiveSequence` with condition and body.
    * py_trees: `decorators.EternalGuard`, with a function as the condition.
    """

    keyword = "guard"
    reasons = ("broken",)
    symbol = "◉"
    counterpart: ClassVar[Counterpart] = Counterpart("ReactiveSequence")

    holds: Child = key(requires_conditions=True, doc="Condition that must succeed at every tick.")
    do: Child = key(doc="Body.")

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the outcomes of the body, and `broken` in all states in which a check may fail."""
        first_check = get_flow(self.holds, state)
        body = get_flow(self.do, first_check.success) if first_check.success else Flow(None, {}, None)
        ends = [*first_check.failures.values()]
        if body.halted is not None:
            ends += get_flow(self.holds, body.halted).failures.values()
        failures = dict(body.failures)
        if (broken_state := join_states(ends)) is not None:
            failures[PossibleFailure(self.keyword, "broken", self.path)] = broken_state
        return Flow(body.success, failures, body.halted)

    def check(self, analysis: NodeAnalysis) -> Iterator[Finding]:
        """Yield an error if the body can never run, and a warning if the guard can never stop the body."""
        condition = analysis.get_flow(self.holds)
        body = analysis.get_flow(self.do)
        if condition is None:
            return
        name = self.holds.path_name
        if body is None:
            message = f"{name} cannot succeed here, so the body of this guard never runs"
            yield make_error(self.holds.span, "never-holds", message)
        elif not condition.failures:
            message = f"{name} cannot fail here, so this guard never stops its body"
            yield make_warning(self.holds.span, "useless-guard", message)
        elif body.halted is None:
            message = f"this guard cannot stop its body: {self.do.path_name} ends in its first tick"
            hint = "Use a sequence (a list) of the condition and the body instead of a guard."
            yield make_warning(self.do.span, "useless-guard", message, hint)
        elif body.success and self._fails_after_release(analysis, body.success):
            message = f"{name} fails as soon as the body of this guard releases the object"
            hint = "Put the release after the guard."
            yield make_warning(self.do.span, "always-breaks", message, hint)

    def _fails_after_release(self, analysis: NodeAnalysis, body_end: FlowState) -> bool:
        """Return True if the body ends with an empty tool, and the condition cannot succeed with that tool.

        A release returns RUNNING until the object lies still; meanwhile, the guard checks its condition, and
        fails.
        """
        is_empty = body_end.tool_states is not None and body_end.find_tool_state(HOLDING) is None
        return is_empty and analysis.compute_flow(self.holds, body_end, False).success is None

    def explain(self, failure: PropagatedFailure) -> str:
        """Return why the guard passed on a failure of its body."""
        return "handles no failures of its body"

    class Behaviour(ReactiveBehaviour):
        """Runs the node."""

        node: Guard

        def step(self) -> Status:
            """Check the condition, then tick the body.

            Raises:
                Fault: The condition returned RUNNING.
            """
            status = self.tick_again(self.node.holds)
            if status is Status.RUNNING:
                message = "is a condition, but returned RUNNING; a condition must succeed or fail in one tick"
                raise Fault(f"{self.behaviour_by_child[self.node.holds].name} {message}", self.path)
            if status is Status.FAILURE:
                self.halt_children([self.node.do])
                cause = self.get_failure(self.node.holds)
                return self.fail_with_reason("broken", f"{cause}: {cause.message}")
            status = self.tick_child(self.node.do)
            return self.fail(self.get_failure(self.node.do)) if status is Status.FAILURE else status
