"""Loop that ends after a number of rounds or with an expected failure."""

from __future__ import annotations

from typing import ClassVar

from py_trees.common import Status

from executive.tree.flow import Enter, Flow, FlowState, joined, loop
from executive.tree.inspection import MinTimes, PassedFailure, listed
from executive.tree.keys import Child, Reasons, key
from executive.tree.loop import Loop


class Repeat(Loop):
    """Again after a success, so many times or until it fails in a certain way.

    If both are given, the one that comes first ends it with success; any other failure is passed on.
    """

    word = "repeat"
    elsewhere: ClassVar = {"loop": "It is called repeat here, or while with a condition."}
    one_of = ("times", "until")

    times: int | None = key(default=None, ge=0, doc="How often at most.")
    until: Reasons = key(default=(), doc="Failures that end it with success.")
    do: Child = key(doc="What is done.")

    @property
    def detail(self) -> str:
        """The end of the loop."""
        ends = [] if self.times is None else [f"{self.times} times"]
        if self.until:
            ends.append(f"until {listed(self.until)}")
        return " or ".join(ends)

    def start(self) -> None:
        """Begin the first round."""
        super().start()
        self._done = 0

    def step(self) -> Status:
        """Tick the body; begin the next round in the same tick if this one took time."""
        while self._done != self.times:
            status = self.run_round(self.do)
            if status is Status.RUNNING:
                return status
            if status is Status.FAILURE:
                failure = self.failure_of(self.do)
                if not failure.matches(self.until):
                    return self.fail(failure)
                self.choose("done", failure)
                return Status.SUCCESS
            self._done += 1
            if not self.next_round() and self._done != self.times:
                return Status.RUNNING
        return Status.SUCCESS

    def flow(self, enter: Enter, state: FlowState) -> Flow:
        """Enter the body again in the state after its success."""
        if self.times == 0:
            return Flow(state, {}, None)
        body, entry = loop(enter, self.do, state, lambda flow: None if self.times == 1 else flow.success)
        ended = [after for failure, after in body.failures.items() if failure.may_match(self.until)]
        success = joined((*ended, None if self.times is None else body.success))
        passed = {one: after for one, after in body.failures.items() if not one.must_match(self.until)}
        return Flow(success, passed, joined((body.halted, entry)))

    def min_time(self, times: MinTimes) -> float:
        """Return the time of all rounds; 0 if a failure may end them."""
        return 0.0 if self.until else (self.times or 0) * times(self.do)

    def explain_unreachable(self, child: Child) -> str:
        """Return the cause, the number of rounds."""
        del child
        return "it is done 0 times"

    def explain(self, failure: PassedFailure) -> str:
        """Return the ends that count as success."""
        del failure
        if self.until:
            return f"ends well only with {listed(self.until)}"
        return f"a failure ends it before its {self.times} times are over"
