"""Loop with a condition."""

from __future__ import annotations

from collections.abc import Iterator

from executive.tree.flow import Flow, FlowFunction, FlowState, find_fixed_point, join_states
from executive.tree.generator_node import NodeRun
from executive.tree.inspection import NodeAnalysis, NodeFinding, PropagatedFailure
from executive.tree.keys import Child, key
from executive.tree.loop import Loop


class While(Loop):
    """Run the body as long as a condition succeeds; the condition runs before every iteration.

    The loop succeeds when the condition fails; a failure of the body is passed on.

    * BehaviorTree.CPP: custom node `while`. `WhileDoElse` runs its body once, and checks the condition again
      at every tick.
    * py_trees: no counterpart.
    """

    keyword = "while"
    symbol = "↺"
    unreachable_reason = "the condition never succeeds"

    condition: Child = key(doc="Condition; its failure ends the loop with success.")
    do: Child = key(doc="Body of the loop.")

    def run(self) -> NodeRun:
        """Run condition and body in turn until the condition or the body fails."""
        while not (failure := (yield from self.run_child(self.condition))):
            if body_failure := (yield from self.run_child(self.do)):
                return body_failure
            yield from self.end_iteration()
        self.report_choice("done", failure)
        return None

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the possible outcomes, by fixed-point iteration over condition and body."""

        def compute_body_flow(condition: Flow) -> Flow:
            return get_flow(self.do, condition.success) if condition.success else Flow(None, {}, None)

        condition, entry = find_fixed_point(
            get_flow, self.condition, state, lambda condition: compute_body_flow(condition).success
        )
        body = compute_body_flow(condition)
        halted = join_states((condition.halted, entry, body.halted))
        return Flow(join_states(condition.failures.values()), body.failures, halted)

    def check(self, analysis: NodeAnalysis) -> Iterator[NodeFinding]:
        """Yield an error if the loop never ends because its condition cannot fail."""
        condition = analysis.get_flow(self.condition)
        if condition is not None and not condition.failures and not analysis.is_halted_by_sibling:
            message = f"this loop never ends: its condition, {analysis.get_name(self.condition)}, cannot fail"
            yield NodeFinding("", "endless", message, "Use `repeat` with `times` or `until`.")

    def explain(self, failure: PropagatedFailure) -> str:
        """Return the cause of a failure: the body, not the condition, failed."""
        return "a failure of the body ends the loop"
