"""Loop that ends after a number of rounds or with an expected failure."""

from __future__ import annotations

from typing import ClassVar

from py_trees.common import Status

from executive.tree.flow import Enter, Flow, FlowState, find_fixed_point, join_states
from executive.tree.inspection import MinTimeFunction, PropagatedFailure, format_reasons
from executive.tree.keys import Child, Reasons, key
from executive.tree.loop import Loop


class Repeat(Loop):
    """Run the body again after each success, up to a number of times or until an expected failure.

    The first limit that is reached ends the loop with success. Any other failure is passed on.
    """

    keyword = "repeat"
    keyword_hints: ClassVar = {"loop": "It is called repeat here, or while with a condition."}
    any_of = ("times", "until")

    times: int | None = key(default=None, ge=0, doc="Maximum number of rounds.")
    until: Reasons = key(default=(), doc="Failures that end the loop with success.")
    do: Child = key(doc="Body of the loop.")

    @property
    def detail(self) -> str:
        """The conditions that end the loop."""
        ends = [] if self.times is None else [f"{self.times} times"]
        if self.until:
            ends.append(f"until {format_reasons(self.until)}")
        return " or ".join(ends)

    def start(self) -> None:
        """Begin the first round."""
        super().start()
        self._completed = 0

    def step(self) -> Status:
        """Tick the body; begin the next round in the same tick if the last one took time."""
        while self._completed != self.times:
            status = self.run_round(self.do)
            if status is Status.RUNNING:
                return status
            if status is Status.FAILURE:
                failure = self.failure_of(self.do)
                if not failure.matches(self.until):
                    return self.fail(failure)
                self.report_choice("done", failure)
                return Status.SUCCESS
            self._completed += 1
            if not self.begin_round() and self._completed != self.times:
                return Status.RUNNING
        return Status.SUCCESS

    def flow(self, enter: Enter, state: FlowState) -> Flow:
        """Enter the body again in the state after its success."""
        if self.times == 0:
            return Flow(state, {}, None)
        body, entry = find_fixed_point(
            enter, self.do, state, lambda flow: None if self.times == 1 else flow.success
        )
        finished = [after for failure, after in body.failures.items() if failure.may_match(self.until)]
        success = join_states((*finished, None if self.times is None else body.success))
        passed = {one: after for one, after in body.failures.items() if not one.must_match(self.until)}
        return Flow(success, passed, join_states((body.halted, entry)))

    def min_time(self, min_time_of: MinTimeFunction) -> float:
        """Return the minimum time of all rounds [s]; 0 if a failure may end the loop with success."""
        return 0.0 if self.until else (self.times or 0) * min_time_of(self.do)

    def explain_unreachable(self, child: Child) -> str:
        """Return the cause: the number of rounds is 0."""
        del child
        return "the body runs 0 times"

    def explain(self, failure: PropagatedFailure) -> str:
        """Return the conditions under which the loop would have succeeded."""
        del failure
        if self.until:
            return f"succeeds only with {format_reasons(self.until)}"
        return f"a failure ends it before its {self.times} rounds are complete"
