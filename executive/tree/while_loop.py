"""Loop with a condition."""

from __future__ import annotations

from collections.abc import Iterator

from py_trees.common import Status

from executive.tree.flow import Enter, Flow, FlowState, find_fixed_point, join_states
from executive.tree.inspection import NodeFacts, NodeFinding, PropagatedFailure
from executive.tree.keys import Child, key
from executive.tree.loop import Loop


class While(Loop):
    """Run the body as long as a condition succeeds; the condition runs before every round.

    The loop succeeds when the condition fails; a failure of the body is passed on.
    """

    keyword = "while"
    symbol = "↺"

    condition: Child = key(doc="Condition; its failure ends the loop with success.")
    do: Child = key(doc="Body of the loop.")

    def start(self) -> None:
        """Begin with the condition."""
        super().start()
        self._current = self.condition

    def step(self) -> Status:
        """Tick the current child; begin the next round in the same tick if the last one took time."""
        while True:
            current = self._current
            status = self.run_round(current)
            if status is Status.RUNNING:
                return status
            if status is Status.FAILURE:
                failure = self.failure_of(current)
                if current is self.do:
                    return self.fail(failure)
                self.report_choice("done", failure)
                return Status.SUCCESS
            if current is self.condition:
                self._current = self.do
            else:
                self._current = self.condition
                if not self.begin_round():
                    return Status.RUNNING

    def flow(self, enter: Enter, state: FlowState) -> Flow:
        """Enter condition and body in turn until no new state occurs."""
        rounds: list[Flow] = []

        def next_entry(condition: Flow) -> FlowState | None:
            rounds.clear()
            if condition.success is None:
                return None
            rounds.append(enter(self.do, condition.success))
            return rounds[0].success

        condition, entry = find_fixed_point(enter, self.condition, state, next_entry)
        failures = {failure: after for flow in rounds for failure, after in flow.failures.items()}
        halted = join_states((condition.halted, entry, *(flow.halted for flow in rounds)))
        return Flow(join_states(condition.failures.values()), failures, halted)

    def check(self, facts: NodeFacts) -> Iterator[NodeFinding]:
        """Find a loop that never ends."""
        condition = facts.flow(self.condition)
        if condition is not None and not condition.failures and not facts.is_halted_by_sibling:
            message = f"this loop never ends: its condition, {facts.name(self.condition)}, cannot fail"
            yield NodeFinding("", "endless", message, "Use repeat with times or until.")

    def explain_unreachable(self, child: Child) -> str:
        """Return the cause: the condition."""
        del child
        return "the condition never succeeds"

    def explain(self, failure: PropagatedFailure) -> str:
        """Return the rule for failures of the body."""
        del failure
        return "a failure of its body ends it"
