"""Control node that runs its body while a condition holds."""

from __future__ import annotations

from collections.abc import Iterator

from py_trees.common import Status

from executive.errors import Fault
from executive.skill import HOLDING
from executive.tree.flow import Flow, FlowFunction, FlowState, PossibleFailure, join_states
from executive.tree.inspection import Counterpart, NodeAnalysis, NodeFinding, PropagatedFailure
from executive.tree.keys import Child, key
from executive.tree.reactive_node import ReactiveNode


class Guard(ReactiveNode):
    """Run the body while a condition holds; when the condition fails, halt the body and fail with `broken`.

    Every tick checks the condition before it ticks the body. If the condition fails at the first tick, the
    body does not start. Otherwise, the guard returns the status of the body.

    * BehaviorTree.CPP: `ReactiveSequence` with condition and body.
    * py_trees: `decorators.EternalGuard`, with a function as the condition.
    """

    keyword = "guard"
    reasons = ("broken",)
    symbol = "◉"
    counterpart = Counterpart("ReactiveSequence")

    holds: Child = key(requires_conditions=True, doc="Condition that must succeed at every tick.")
    do: Child = key(doc="Body.")

    def step(self) -> Status:
        """Check the condition, then tick the body.

        Raises:
            Fault: The condition returned RUNNING.
        """
        status = self.tick_again(self.holds)
        if status is Status.RUNNING:
            message = "is a condition, but returned RUNNING; a condition must succeed or fail in one tick"
            raise Fault(f"{self.holds.name} {message}", self.path)
        if status is Status.FAILURE:
            self.halt_children([self.do])
            cause = self.get_failure(self.holds)
            return self.fail_with_reason("broken", f"{cause}: {cause.message}")
        status = self.tick_child(self.do)
        return self.fail(self.get_failure(self.do)) if status is Status.FAILURE else status

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

    def check(self, analysis: NodeAnalysis) -> Iterator[NodeFinding]:
        """Yield an error if the body can never run, and a warning if the guard can never stop the body."""
        condition, body = analysis.get_flow(self.holds), analysis.get_flow(self.do)
        if condition is None:
            return
        name = analysis.get_name(self.holds)
        if body is None:
            message = f"{name} cannot succeed here, so the body of this guard never runs"
            yield NodeFinding(self.holds, "never-holds", message)
        elif not condition.failures:
            message = f"{name} cannot fail here, so this guard never stops its body"
            yield NodeFinding(self.holds, "useless-guard", message, is_warning=True)
        elif body.halted is None:
            message = f"this guard cannot stop its body: {analysis.get_name(self.do)} ends in its first tick"
            hint = "Use a sequence (a list) of the condition and the body instead of a guard."
            yield NodeFinding(self.do, "useless-guard", message, hint, is_warning=True)
        elif body.success and self._fails_after_release(analysis, body.success):
            message = f"{name} fails as soon as the body of this guard releases the object"
            hint = "Put the release after the guard."
            yield NodeFinding(self.do, "always-breaks", message, hint, is_warning=True)

    def _fails_after_release(self, analysis: NodeAnalysis, body_end: FlowState) -> bool:
        """Return True if the body ends with an empty tool, and the condition cannot succeed with that tool.

        A release returns RUNNING until the object lies still; meanwhile, the guard checks its condition, and
        fails.
        """
        is_empty = body_end.tool_states is not None and body_end.find_tool_state(HOLDING) is None
        return is_empty and analysis.compute_flow(self.holds, body_end).success is None

    def explain(self, failure: PropagatedFailure) -> str:
        """Return why the guard passed on a failure of its body."""
        return "handles no failures of its body"
