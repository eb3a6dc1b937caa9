"""Control nodes that change the result or limit the time of one body: invert, not, succeed and timeout."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, cast

from py_trees.common import Status

from executive.skill import Seconds
from executive.tree.flow import Flow, FlowFunction, FlowState, PossibleFailure, join_states
from executive.tree.keys import key
from executive.tree.node import ControlNode, Counterpart, PropagatedFailure
from executive.tree.specification import Child, Node
from executive.tree.tree_node import NodeBehaviour


class Invert(ControlNode):
    """Succeed if the body fails; fail with `inverted` if the body succeeds.

    * BehaviorTree.CPP: `Inverter`.
    * py_trees: `decorators.Inverter`.
    """

    keyword = "invert"
    reasons = ("inverted",)
    symbol = "¬"
    counterpart: ClassVar[Counterpart] = Counterpart("Inverter")

    do: Child = key(shorthand=True, doc="Body.")

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the possible outcomes of the body, with success and failure exchanged."""
        flow = get_flow(self.do, state)
        inverted = PossibleFailure(self.keyword, "inverted", self.path)
        failures = {} if flow.success is None else {inverted: flow.success}
        return Flow(join_states(flow.failures.values()), failures, flow.halted)

    class Behaviour(NodeBehaviour):
        """Runs the node."""

        node: Invert

        def step(self) -> Status:
            """Tick the body."""
            status = self.await_child(self.node.do)
            if status is Status.SUCCESS:
                name = self.behaviour_by_child[self.node.do].name
                return self.fail_with_reason("inverted", f"{name} succeeded")
            return Status.SUCCESS if status is Status.FAILURE else status


class NotCondition(Invert):
    """Succeed if the condition fails; fail with `inverted` if the condition succeeds.

    * BehaviorTree.CPP: `Inverter`.
    * py_trees: `decorators.Inverter`.
    """

    keyword = "not"
    is_condition = True

    do: Child = key(shorthand=True, in_path=False, requires_conditions=True, doc="Condition.")


class Succeed(ControlNode):
    """Succeed after success and failure of the body; without a body, succeed at once.

    * BehaviorTree.CPP: `ForceSuccess`; without a body, `AlwaysSuccess`.
    * py_trees: `decorators.FailureIsSuccess`; without a body, `behaviours.Success`.
    """

    keyword = "succeed"
    symbol = "✓"

    do: Child | None = key(shorthand=True, default=None, doc="Body.")

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the possible outcomes: success after success and failure of the body, or a halt."""
        if self.do is None:
            return Flow(state, {}, None)
        flow = get_flow(self.do, state)
        return Flow(join_states((flow.success, *flow.failures.values())), {}, flow.halted)

    @property
    def counterpart(self) -> Counterpart | None:
        """`ForceSuccess` of BehaviorTree.CPP; without a body, `AlwaysSuccess`."""
        return Counterpart("ForceSuccess" if self.do else "AlwaysSuccess")

    class Behaviour(NodeBehaviour):
        """Runs the node."""

        node: Succeed

        def step(self) -> Status:
            """Tick the body, if any."""
            if self.node.do is None:
                return Status.SUCCESS
            status = self.await_child(self.node.do)
            if status is Status.FAILURE:
                self.report_choice("succeed despite the failure", self.get_failure(self.node.do))
            return Status.RUNNING if status is Status.RUNNING else Status.SUCCESS


class Timeout(ControlNode):
    """Fail with the reason `timeout` if the body takes longer than a limit on the clock of the run.

    A body that ends in the same tick in which the clock reaches the limit is in time.

    * BehaviorTree.CPP: `Timeout`. A timer thread halts the body when the wall clock reaches the limit, and
      the node fails in the next tick.
    * py_trees: `decorators.Timeout`, with the limit on the wall clock.
    """

    keyword = "timeout"
    reasons = ("timeout",)
    symbol = "◷"

    seconds: Seconds = key(gt=0, accepts_expression=True, doc="Maximum duration of the body [s].")
    do: Child = key(doc="Body.")

    @property
    def detail(self) -> str:
        """The limit as a text: `5 s`."""
        return f"{self.describe_value('seconds')} s"

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the outcomes of the body, and the timeout if the body can take more than one tick."""
        flow = get_flow(self.do, state)
        failures = dict(flow.failures)
        if flow.halted is not None:
            failures[PossibleFailure(self.keyword, "timeout", self.path)] = flow.halted
        return Flow(flow.success, failures, flow.halted)

    @property
    def first_child(self) -> Node | None:
        """The body."""
        return self.do

    def explain(self, failure: PropagatedFailure) -> str:
        """Return the duration of the body and the limit."""
        return f"handles no failures; {failure.duration:.2f} of {self.describe_value('seconds')} s had passed"

    def advise(self, failure: PropagatedFailure) -> Iterator[tuple[str, Node]]:
        """Yield the advice to increase the limit after a timeout."""
        if failure.child is None:
            yield f"allow more than {self.describe_value('seconds')} s", self

    @property
    def counterpart(self) -> Counterpart | None:
        """`Timeout` of BehaviorTree.CPP, with the limit in whole milliseconds."""
        # A limit that is unknown during the export is infinite here.
        return Counterpart("Timeout", {"msec": max(1, round(1000 * min(self.seconds, 1e6)))})

    class Behaviour(NodeBehaviour):
        """Runs the node."""

        node: Timeout

        def start(self) -> None:
            """Set the deadline."""
            self._seconds = cast("float", self.read_value("seconds"))
            self._deadline = self.clock.now + self._seconds

        def step(self) -> Status:
            """Tick the body, then compare the clock with the deadline."""
            status = self.tick_child(self.node.do)
            if status is Status.FAILURE:
                return self.fail(self.get_failure(self.node.do))
            # 1 ns covers the rounding errors of a clock that sums control periods.
            if status is Status.RUNNING and self.clock.now >= self._deadline - 1e-9:
                self.halt_children([self.node.do])
                message = f"the body did not end within {self._seconds:g} s"
                return self.fail_with_reason("timeout", message)
            return status
