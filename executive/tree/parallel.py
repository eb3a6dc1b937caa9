"""Control node whose children run at the same time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from py_trees.common import Status

from executive.tree.failure import Failure
from executive.tree.flow import (
    Flow,
    FlowFunction,
    FlowState,
    PossibleFailure,
    combine_tools,
    find_tools_at_end,
    join_states,
)
from executive.tree.inspection import MinTimeFunction, PropagatedFailure
from executive.tree.keys import Children, key
from executive.tree.node import ControlNode

MAX_BRANCHES = 200
"""Maximum number of branches; limits the time of the checker, which compares every pair of branches."""


class Parallel(ControlNode):
    """Run all children at the same time.

    Every running child is ticked once per tick, in order; a child that has ended is not run again. The node
    decides after all running children were ticked:

    * If enough children have succeeded, the node succeeds, even if others failed in the same tick, and halts
      the running children.
    * If too many children have failed, the node fails with the first failure; of failures in the same tick,
      with the failure of the child listed first. With `halt`, the node halts the running children at once;
      without `halt`, it lets them finish, so that a motion of the arm is completed.

    With `wait_for: lead`, the node ends in the tick in which its first child, the lead, ends, with the status
    of the lead, and halts the others.
    """

    keyword = "parallel"
    symbol, shape = "⇉", "parallelogram"

    wait_for: Literal["all", "any", "lead"] | int = key(
        default="all", ge=1, max_key="do",
        doc="Number of children that must succeed: `all`, `any` or a number; `lead`: only the first child.",
    )  # fmt: skip
    halt: bool = key(
        default=False,
        doc="True to halt the others at once after a failure, instead of letting them finish.",
    )
    do: Children = key(shorthand=True, max_count=MAX_BRANCHES, doc="Nodes to run at the same time.")

    @property
    def _has_lead(self) -> bool:
        return self.wait_for == "lead"

    @property
    def _required_count(self) -> int:
        """Number of children that must succeed, if no child is the lead."""
        if isinstance(self.wait_for, int):
            return self.wait_for
        return 1 if self.wait_for == "any" else len(self.do)

    @property
    def detail(self) -> str:
        """The number of children that must succeed, and whether a failure halts the others."""
        if self._has_lead:
            return "wait for the lead"
        count, required = len(self.do), self._required_count
        wait = "wait for all" if required == count else f"wait for {required} of {count}"
        return f"{wait}, halt" if self.halt else wait

    def start(self) -> None:
        """Begin with all children."""
        self._running = list(self.do)
        self._missing_count = self._required_count
        self._failure: Failure | None = None
        self._tick_children = self._tick_lead if self._has_lead else self._tick_all

    def step(self) -> Status:
        """Tick every running child."""
        return self._tick_children()

    def _tick_lead(self) -> Status:
        """Tick the lead; if the lead is still running, tick the other running children."""
        lead, *others = self._running
        status = self.run_child(lead)
        if status is not Status.RUNNING:
            self.halt_children(others)
            return status if status is Status.SUCCESS else self.fail(self.get_failure(lead))
        for child in others:
            status = self.run_child(child)
            if status is not Status.RUNNING:
                self._running.remove(child)
            if status is Status.FAILURE:
                self.report_choice("go on without this branch", self.get_failure(child))
        return Status.RUNNING

    def _tick_all(self) -> Status:
        has_child_ended = not self._running
        for child in self._running:
            if self.run_child(child) is not Status.RUNNING:
                has_child_ended = True
        return self._decide() if has_child_ended else Status.RUNNING

    def _decide(self) -> Status:
        """Count the children that ended in this tick, and return the resulting status of the node."""
        ticked = self._running
        self._running = [child for child in ticked if child.status is Status.RUNNING]
        self._missing_count -= sum(child.status is Status.SUCCESS for child in ticked)
        failures = [self.get_failure(child) for child in ticked if child.status is Status.FAILURE]
        self._failure = next(iter(failures), None) if self._failure is None else self._failure
        if self._missing_count <= 0:
            self.halt_children(self._running)
            self._report_choices("enough others succeeded", failures)
            return Status.SUCCESS
        must_fail = self._missing_count > len(self._running)
        if self._running and not (must_fail and self.halt):
            choice = "let the others finish, then fail" if must_fail else "go on with the others"
            self._report_choices(choice, failures)
            return Status.RUNNING
        self.halt_children(self._running)
        assert self._failure is not None
        others = [failure for failure in failures if failure is not self._failure]
        self._report_choices(f"fail with {self._failure}", others)
        return self.fail(self._failure)

    def _report_choices(self, choice: str, failures: Sequence[Failure]) -> None:
        for failure in failures:
            self.report_choice(choice, failure)

    def compute_flow(self, flow_of: FlowFunction, state: FlowState) -> Flow:
        """Return the possible ends: every child is entered in the same state, and the ends are combined."""
        flows = [flow_of(branch, state) for branch in self.do]
        after_halt = [find_tools_at_end(flow, state, may_be_halted=True) for flow in flows]
        halted = join_states(flow.halted for flow in flows)
        halted = halted and halted.with_tools(combine_tools(state.tools, after_halt))
        failures: dict[PossibleFailure, FlowState] = {}
        if self._has_lead:
            others = after_halt[1:]
            for failure, after in flows[0].failures.items():
                failures[failure] = after.with_tools(combine_tools(state.tools, [after.tools, *others]))
            end = flows[0].success
            success = end and end.with_tools(combine_tools(state.tools, [end.tools, *others]))
            return Flow(success, failures, halted)
        required = self._required_count
        ends = [find_tools_at_end(flow, state, self.halt or required < len(flows)) for flow in flows]
        if sum(bool(flow.failures) for flow in flows) > len(flows) - required:
            for index, flow in enumerate(flows):
                others = [*ends[:index], *ends[index + 1 :]]
                for failure, after in flow.failures.items():
                    failures[failure] = after.with_tools(combine_tools(state.tools, [after.tools, *others]))
        return Flow(self._compute_success_state(flows, state), failures, halted)

    def _compute_success_state(self, flows: Sequence[Flow], state: FlowState) -> FlowState | None:
        """Return the state after enough branches have succeeded; None if too few branches can succeed."""
        succeeding = [flow.success for flow in flows if flow.success is not None]
        success = join_states(succeeding)
        if success is None or len(succeeding) < self._required_count:
            return None
        if self._required_count < len(flows):
            ends = [find_tools_at_end(flow, state, may_be_halted=True) for flow in flows]
            return success.with_tools(combine_tools(state.tools, ends))
        end = success.with_variables(name for one in succeeding for name in one.written or ())
        return end.with_tools(combine_tools(state.tools, [one.tools for one in succeeding]))

    def min_time(self, min_time_of: MinTimeFunction) -> float:
        """Return the minimum time of the lead, or the n-th shortest if n children must succeed [s]."""
        if self._has_lead:
            return min_time_of(self.do[0])
        return sorted(map(min_time_of, self.do))[self._required_count - 1]

    @property
    def concurrent_children(self) -> Children:
        """All children."""
        return self.do

    @property
    def children_halted_by_sibling(self) -> Children:
        """All children except the lead; empty if no child is the lead."""
        return self.do[1:] if self._has_lead else ()

    def explain(self, failure: PropagatedFailure) -> str:
        """Return a text with the number of children that must succeed, and the other failures."""
        if self._has_lead:
            return "ends with the status of its first child, the lead"
        count = len(self.do)
        texts = {"all": f"all {count}", "any": f"one of its {count}"}
        required = texts.get(str(self.wait_for), f"{self.wait_for} of its {count}")
        # The handled failures may include the failure passed on: it was reported while other branches ran.
        others = [reason for reason in failure.handled_counts if reason != failure.reason]
        return f"needs {required} branches" + (f"; also failed: {', '.join(others)}" if others else "")
