"""Loop that ends after a number of iterations, with an expected failure, or at the limit of a counter."""

from __future__ import annotations

from collections.abc import Iterator

from executive.skill import ANY, EMPTY, HOLDING
from executive.tree.failure import Reason, format_reasons
from executive.tree.flow import Flow, FlowFunction, FlowState, find_fixed_point, join_states
from executive.tree.generator_node import NodeRun
from executive.tree.inspection import Counterpart, NodeAnalysis, NodeFinding, PropagatedFailure
from executive.tree.keys import Child, KeySection, key
from executive.tree.loop import Loop


class CounterLimits(KeySection):
    """Limits of counters of the run; the loop ends as soon as one counter reaches its limit."""

    any_of = ("placed", "rejected", "elapsed")

    placed: int | None = key(default=None, ge=0, doc="Number of items that the run has placed.")
    rejected: int | None = key(default=None, ge=0, doc="Number of items that the run has rejected.")
    elapsed: float | None = key(default=None, gt=0, doc="Time since the start of the run [s].")

    def __str__(self) -> str:
        return ", ".join(f"{name}: {limit:g}" for name, limit in self.list_limits())

    def list_limits(self) -> list[tuple[str, float]]:
        """Return the counters that have a limit, with their limits."""
        return [(name, limit) for name in self.keys if (limit := getattr(self, name)) is not None]


class Repeat(Loop):
    """Run the body until a number of iterations, an expected failure, or the limit of a counter is reached.

    Each of these three conditions ends the loop with success. The loop reads the counters before each
    iteration, and does not interrupt an iteration. Any other failure of the body ends the loop and is passed
    on.

    * BehaviorTree.CPP: `Repeat`; with `until`, a custom node `repeat`, as failures have no reasons there.
    * py_trees: `decorators.Repeat`. Each iteration begins in a new tick, and there is no `until`.
    """

    keyword = "repeat"
    any_of = ("times", "until")
    unreachable_reason = "the body runs 0 times"

    times: int | None = key(default=None, ge=0, doc="Maximum number of iterations.")
    until: tuple[Reason | CounterLimits, ...] = key(
        default=(), doc="Failures and limits of counters that end the loop with success."
    )
    do: Child = key(doc="Body of the loop.")

    @property
    def detail(self) -> str:
        """The conditions that end the loop, as a text."""
        conditions = [] if self.times is None else [f"{self.times} times"]
        if self.until:
            conditions.append(f"until {format_reasons(self.until)}")
        return " or ".join(conditions)

    def run(self) -> NodeRun:
        """Run the body until the loop is complete, or the body fails."""
        iteration_count = 0
        while not self._is_complete(iteration_count):
            if failure := (yield from self.run_child(self.do)):
                if not failure.matches(self._expected_reasons):
                    return failure
                self.report_choice("done", failure)
                return None
            iteration_count += 1
            if not self._is_complete(iteration_count):
                yield from self.end_iteration()
        if reached_limit := self._find_reached_limit():
            self.report_choice(f"done, {reached_limit}")
        return None

    @property
    def _expected_reasons(self) -> list[Reason]:
        """Failures that end the loop with success."""
        return [end for end in self.until if isinstance(end, Reason)]

    @property
    def _limits(self) -> list[tuple[str, float]]:
        """Counters that have a limit, with their limits."""
        return [limit for end in self.until if isinstance(end, CounterLimits) for limit in end.list_limits()]

    @property
    def _is_empty(self) -> bool:
        """True if the body never runs."""
        return self.times == 0 or any(limit == 0 for _, limit in self._limits)

    def _is_complete(self, iteration_count: int) -> bool:
        """Return True if no further iteration may begin."""
        return iteration_count == self.times or bool(self._find_reached_limit())

    def _find_reached_limit(self) -> str:
        """Return the first limit that a counter has reached, as a text: `placed: 4`; "" if none."""
        limits = (f"{name}: {limit:g}" for name, limit in self._limits if self._read_counter(name) >= limit)
        return next(limits, "")

    def _read_counter(self, name: str) -> float:
        return self.clock.now if name == "elapsed" else self.ledger.count_items(name)

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the possible outcomes; the next iteration starts in the state after success of the body."""
        if self._is_empty:
            return Flow(state, {}, None)
        body, entry = find_fixed_point(
            get_flow, self.do, state, lambda body: None if self.times == 1 else body.success
        )
        reasons = self._expected_reasons
        expected_ends = [end for failure, end in body.failures.items() if failure.may_match(reasons)]
        # A counter may have reached its limit before the first iteration.
        last_ends = (None if self.times is None else body.success, entry if self._limits else None)
        success = join_states((*expected_ends, *last_ends))
        failures = {cause: end for cause, end in body.failures.items() if not cause.must_match(reasons)}
        return Flow(success, failures, join_states((body.halted, entry)))

    def check(self, analysis: NodeAnalysis) -> Iterator[NodeFinding]:
        """Yield an error if only a limit of `placed` can end the loop, and the body places no item."""
        has_only_placed = {name for name, _ in self._limits} == {"placed"} and not self._expected_reasons
        if not has_only_placed or self._is_empty or self.times or analysis.is_concurrent:
            return
        skills = analysis.list_skills().values()
        if not any(skill is None or skill.tool_state in ((HOLDING, EMPTY), (ANY, EMPTY)) for skill in skills):
            message = "this loop never succeeds: its body releases no object, so `placed` does not increase"
            hint = "Add a failure reason or `elapsed` to `until`, or add `times`."
            yield NodeFinding("", "endless", message, hint)

    def explain(self, failure: PropagatedFailure) -> str:
        """Return why the loop passed on a failure of its body."""
        if self.until:
            return f"this failure is not in until ({format_reasons(self.until)})"
        return f"a failure ends the loop before its {self.times} iterations are complete"

    @property
    def counterpart(self) -> Counterpart | None:
        """`Repeat` of BehaviorTree.CPP; None with `until`."""
        return None if self.until else Counterpart("Repeat", {"num_cycles": "times"})
