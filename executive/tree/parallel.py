"""Control node whose children run at the same time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Annotated, Literal

from py_trees.common import Status
from pydantic import Field

from executive.skill import ToolState
from executive.tree.blackboard import Failure
from executive.tree.flow import Flow, FlowFunction, FlowState, ToolStates, join_states
from executive.tree.keys import Children, key
from executive.tree.node import ControlNode, Counterpart, PropagatedFailure
from executive.tree.tree_node import NodeBehaviour

MAX_CHILDREN = 200
"""Maximum number of children; the checker compares all pairs of children."""


class Parallel(ControlNode):
    """Run all children at the same time.

    Every running child is ticked once per tick, in order; a child that has ended is not run again. The node
    decides after all running children were ticked:

    * If enough children have succeeded, the node halts the running children and succeeds, even if other
      children failed in the same tick.
    * If too many children have failed, the node fails with the first failure. If several children fail in
      one tick, the failure of the first of them in `do` counts. With `halt`, the node halts the running
      children at once; without `halt`, the running children finish.

    With `wait_for: lead`, the first child is the lead: the node ends in the same tick as the lead, with the
    status of the lead, and halts the other children.

    * BehaviorTree.CPP: `ParallelAll` for `all`; `Parallel` for `any`, and with `halt`. `Parallel` ends as
      soon as the result is known, so that later children may miss the last tick. The custom node `parallel`
      represents `lead`, and other numbers without `halt`.
    * py_trees: `Parallel` with the policy `SuccessOnAll` or `SuccessOnOne`. With both policies, the first
      failure of a child ends the node.
    """

    keyword = "parallel"
    symbol = "⇉"

    wait_for: Literal["all", "any", "lead"] | Annotated[int, Field(ge=1)] = key(
        default="all", max_key="do",
        doc="Number of children that must succeed: `all`, `any` or a number; `lead`: only the first child.",
    )  # fmt: skip
    halt: bool = key(
        default=False,
        doc="True to halt the running children as soon as too many have failed; False to let them finish.",
    )
    do: Children = key(shorthand=True, max_count=MAX_CHILDREN, doc="Nodes to run at the same time.")

    @property
    def has_lead(self) -> bool:
        """True if the first child alone decides the end of the node."""
        return self.wait_for == "lead"

    @property
    def required_count(self) -> int:
        """Number of children that must succeed, if no child is the lead."""
        if isinstance(self.wait_for, int):
            return self.wait_for
        return 1 if self.wait_for == "any" else len(self.do)

    @property
    def detail(self) -> str:
        """The number of children that must succeed, and the option `halt`, as a text."""
        if self.has_lead:
            return "wait for the lead"
        child_count = len(self.do)
        required_count = self.required_count
        required = "all" if required_count == child_count else f"{required_count} of {child_count}"
        return f"wait for {required}, halt" if self.halt else f"wait for {required}"

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the combinations of the possible outcomes of the children, which all start in `state`."""
        flows = [get_flow(child, state) for child in self.do]
        halted_ends = [find_end_tool_states(flow, state, can_be_halted=True) for flow in flows]
        halted = join_states(flow.halted for flow in flows)
        halted = halted and halted.with_tool_states(combine_tool_states(state.tool_states, halted_ends))
        if self.has_lead:
            lead = flows[0]
            others = halted_ends[1:]
            failures = {cause: _with_siblings(state, end, others) for cause, end in lead.failures.items()}
            return Flow(lead.success and _with_siblings(state, lead.success, others), failures, halted)
        failures = {}
        can_be_halted = self.halt or self.required_count < len(flows)
        ends = [find_end_tool_states(flow, state, can_be_halted) for flow in flows]
        can_fail = len([flow for flow in flows if flow.failures]) > len(flows) - self.required_count
        for index, flow in enumerate(flows if can_fail else ()):
            others = [*ends[:index], *ends[index + 1 :]]
            failures |= {cause: _with_siblings(state, end, others) for cause, end in flow.failures.items()}
        successes = [flow.success for flow in flows if flow.success is not None]
        success = join_states(successes)
        if success is None or len(successes) < self.required_count:
            return Flow(None, failures, halted)
        success_ends = halted_ends
        if self.required_count == len(flows):
            success_ends = [end.tool_states for end in successes]
            names = (name for end in successes for name in end.written_variables or ())
            success = success.with_variables(names)
        success = success.with_tool_states(combine_tool_states(state.tool_states, success_ends))
        return Flow(success, failures, halted)

    @property
    def concurrent_children(self) -> Children:
        """All children."""
        return self.do

    @property
    def children_halted_by_sibling(self) -> Children:
        """All children except the lead; empty if no child is the lead."""
        return self.do[1:] if self.has_lead else ()

    def explain(self, failure: PropagatedFailure) -> str:
        """Return the number of children that must succeed, and the failures of the other children."""
        if self.has_lead:
            return "ends with the status of its first child, the lead"
        child_count = len(self.do)
        counts = {"all": f"all {child_count}", "any": f"one of its {child_count}"}
        count = counts.get(str(self.wait_for), f"{self.wait_for} of its {child_count}")
        # The handled failures may include the first failure, which the node passed on later.
        other_names = ", ".join(name for name in failure.handled_counts if name != failure.name)
        return f"needs {count} branches" + (f"; also failed: {other_names}" if other_names else "")

    @property
    def counterpart(self) -> Counterpart | None:
        """`ParallelAll` or `Parallel` of BehaviorTree.CPP; None if no node ends under the same conditions."""
        child_count = len(self.do)
        required_count = self.required_count
        if not self.has_lead and (self.halt or required_count == 1):
            failure_count = child_count - required_count + 1
            return Counterpart("Parallel", {"success_count": required_count, "failure_count": failure_count})
        is_all = not self.has_lead and required_count == child_count
        return Counterpart("ParallelAll", {"max_failures": 1}) if is_all else None

    class Behaviour(NodeBehaviour):
        """Runs the node."""

        node: Parallel

        def start(self) -> None:
            """Begin with all children."""
            self._running_children = list(self.node.do)
            self._missing_successes = self.node.required_count
            self._first_failure: Failure | None = None

        def step(self) -> Status:
            """Tick every running child."""
            return self._tick_lead() if self.node.has_lead else self._tick_all()

        def _tick_lead(self) -> Status:
            """Tick the lead; if the lead is still running, tick the other running children."""
            lead, *siblings = self._running_children
            status = self.await_child(lead)
            if status is not Status.RUNNING:
                self.halt_children(siblings)
                return status if status is Status.SUCCESS else self.fail(self.get_failure(lead))
            for child in siblings:
                status = self.await_child(child)
                if status is not Status.RUNNING:
                    self._running_children.remove(child)
                if status is Status.FAILURE:
                    self.report_choice("go on without this branch", self.get_failure(child))
            return Status.RUNNING

        def _tick_all(self) -> Status:
            """Tick all running children, count the children that end, and return the status of the node."""
            statuses = [(child, self.await_child(child)) for child in self._running_children]
            running_children = [child for child, status in statuses if status is Status.RUNNING]
            failures = [self.get_failure(child) for child, status in statuses if status is Status.FAILURE]
            self._running_children = running_children
            self._missing_successes -= len(statuses) - len(running_children) - len(failures)
            self._first_failure = self._first_failure or next(iter(failures), None)
            if self._missing_successes <= 0:
                self.halt_children(running_children)
                self._report_choices("enough others succeeded", failures)
                return Status.SUCCESS
            # The node has failed if the success of all running children is not enough.
            has_failed = self._missing_successes > len(running_children)
            if running_children and not (has_failed and self.node.halt):
                choice = "let the others finish, then fail" if has_failed else "go on with the others"
                self._report_choices(choice, failures)
                return Status.RUNNING
            self.halt_children(running_children)
            assert self._first_failure is not None
            later_failures = [failure for failure in failures if failure is not self._first_failure]
            self._report_choices(f"fail with {self._first_failure}", later_failures)
            return self.fail(self._first_failure)

        def _report_choices(self, choice: str, failures: Sequence[Failure]) -> None:
            for failure in failures:
                self.report_choice(choice, failure)


def _with_siblings(entry: FlowState, end: FlowState, others: Iterable[ToolStates]) -> FlowState:
    """Return the state `end` after one child, with the tool states `others` after its siblings."""
    return end.with_tool_states(combine_tool_states(entry.tool_states, [end.tool_states, *others]))


def find_end_tool_states(flow: Flow, entry: FlowState, can_be_halted: bool) -> ToolStates:
    """Return the possible tool states after a branch from `entry`, also after halts if `can_be_halted`."""
    halt_states = (flow.halted, entry) if can_be_halted else ()
    return (join_states((flow.success, *flow.failures.values(), *halt_states)) or entry).tool_states


def combine_tool_states(entry: ToolStates, branch_ends: Iterable[ToolStates]) -> ToolStates:
    """Return the possible tool states after parallel branches, of which at most one uses the tool.

    `entry` contains the states before the branches; `branch_ends` contains the states after each branch.
    """
    changed_ends = [states for states in branch_ends if _remove_history(states) != _remove_history(entry)]
    if any(states is None for states in changed_ends):
        return None
    return frozenset(state for states in changed_ends for state in states or ()) if changed_ends else entry


def _remove_history(tool_states: ToolStates) -> frozenset[tuple[ToolState, str]] | None:
    """Return the possible states of the tool and their causes, without handled failures and motions."""
    return None if tool_states is None else frozenset((state.state, state.cause) for state in tool_states)
