"""Loop that ends after a number of iterations or with an expected failure."""

from __future__ import annotations

from typing import ClassVar

from py_trees.common import Status

from executive.tree.counterpart import Counterpart
from executive.tree.flow import Flow, FlowFunction, FlowState, find_fixed_point, join_states
from executive.tree.inspection import MinTimeFunction, PropagatedFailure, format_reasons
from executive.tree.keys import Child, Reasons, key
from executive.tree.loop import Loop


class Repeat(Loop):
    """Run the body repeatedly, up to a maximum number of iterations or until an expected failure.

    The loop succeeds in both cases. Any other failure of the body ends the loop and is passed on.

    * BehaviorTree.CPP: `Repeat`; with `until`, a custom node `repeat`, because failures have no reasons.
    * py_trees: `decorators.Repeat`. Each iteration begins in a new tick, and there is no `until`.
    """

    keyword = "repeat"
    keyword_hints: ClassVar = {"loop": "Write repeat, or while for a loop with a condition."}
    any_of = ("times", "until")

    times: int | None = key(default=None, ge=0, doc="Maximum number of iterations.")
    until: Reasons = key(default=(), doc="Failures that end the loop with success.")
    do: Child = key(doc="Body of the loop.")

    @property
    def detail(self) -> str:
        """The conditions that end the loop, as a text."""
        conditions = [] if self.times is None else [f"{self.times} times"]
        if self.until:
            conditions.append(f"until {format_reasons(self.until)}")
        return " or ".join(conditions)

    def start(self) -> None:
        """Begin the first iteration."""
        super().start()
        self._iteration_count = 0

    def step(self) -> Status:
        """Tick the body; after its end, begin the next iteration, in the same tick if possible."""
        while self._iteration_count != self.times:
            status = self.tick_in_iteration(self.do)
            if status is Status.RUNNING:
                return status
            if status is Status.FAILURE:
                failure = self.get_failure(self.do)
                if not failure.matches(self.until):
                    return self.fail(failure)
                self.report_choice("done", failure)
                return Status.SUCCESS
            self._iteration_count += 1
            if not self.begin_iteration() and self._iteration_count != self.times:
                return Status.RUNNING
        return Status.SUCCESS

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the possible outcomes; the next iteration starts in the state after success of the body."""
        if self.times == 0:
            return Flow(state, {}, None)
        body, entry = find_fixed_point(
            get_flow, self.do, state, lambda body: None if self.times == 1 else body.success
        )
        expected_ends = [end for failure, end in body.failures.items() if failure.may_match(self.until)]
        success = join_states((*expected_ends, None if self.times is None else body.success))
        failures = {cause: end for cause, end in body.failures.items() if not cause.must_match(self.until)}
        return Flow(success, failures, join_states((body.halted, entry)))

    def min_time(self, get_min_time: MinTimeFunction) -> float:
        """Return the minimum time of all iterations [s]; 0 if a failure may end the loop with success."""
        return 0.0 if self.until else (self.times or 0) * get_min_time(self.do)

    def explain_unreachable(self, child: Child) -> str:
        """Return a text that explains why the body never runs: the number of iterations is 0."""
        del child
        return "the body runs 0 times"

    def explain(self, failure: PropagatedFailure) -> str:
        """Return the condition under which the loop succeeds."""
        del failure
        if self.until:
            return f"succeeds only with {format_reasons(self.until)}"
        return f"a failure ends the loop before its {self.times} iterations are complete"

    @property
    def counterpart(self) -> Counterpart | None:
        """`Repeat` of BehaviorTree.CPP; None with `until`."""
        return None if self.until else Counterpart("Repeat", {"num_cycles": "times"})
