"""Control nodes without children that use expressions: `holds`, `set`, `fail` and `finish`; and `if`."""

from __future__ import annotations

from typing import ClassVar

from py_trees.common import Status

from executive.errors import Finished
from executive.tree.flow import Flow, FlowFunction, FlowState, PossibleFailure, join_states
from executive.tree.keys import AnyValue, key
from executive.tree.node import ControlNode, Counterpart
from executive.tree.specification import Child, Expression, VariableName
from executive.tree.tree_node import NodeBehaviour


class Holds(ControlNode):
    """Succeed if an expression is true, otherwise fail with `false`.

    Where a condition is expected, the expression may stand alone: `guard: {holds: $items.count > 0, do: …}`.

    * BehaviorTree.CPP: `ScriptCondition`.
    * py_trees: `CheckBlackboardVariableValue`, with one comparison of one variable.
    """

    keyword = "holds"
    reasons = ("false",)
    symbol = "?="
    is_condition = True

    holds: Expression = key(shorthand=True, doc="Expression that is true or false.")

    @property
    def detail(self) -> str:
        """The expression."""
        return str(self.holds)

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return success and failure, both in the unchanged state."""
        del get_flow
        return Flow(state, {PossibleFailure(self.keyword, "false", self.path): state}, None)

    @property
    def counterpart(self) -> Counterpart | None:
        """`ScriptCondition` of BehaviorTree.CPP; None if its scripts have no such operation."""
        return Counterpart("ScriptCondition", {"code": "holds"})

    class Behaviour(NodeBehaviour):
        """Runs the node."""

        node: Holds

        def step(self) -> Status:
            """Evaluate the expression."""
            if self.scope.evaluate(self.node.holds):
                return Status.SUCCESS
            operands = ", ".join(self.scope.describe(self.node.holds))
            return self.fail_with_reason("false", f"{self.node.holds} is false: {operands}")


class If(ControlNode):
    """Run `then` if a condition succeeds, otherwise `else`; without `else`, succeed at once.

    The condition is checked once. A failure of `then` or `else` is passed on.

    * BehaviorTree.CPP: `IfThenElse` with two or three children, which checks its condition once, too.
    * py_trees: no counterpart.
    """

    keyword = "if"
    symbol = "?"
    unreachable_reason = "the condition always has the other result"

    holds: Child = key(requires_conditions=True, doc="Condition, or an expression.")
    then: Child = key(doc="Runs if the condition succeeds.")
    else_: Child | None = key(default=None, doc="Runs if the condition fails.")

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the possible outcomes of both branches."""
        condition = get_flow(self.holds, state)
        failed = condition.join_handled()
        branches = [get_flow(self.then, condition.success)] if condition.success else []
        if failed is not None:
            branches.append(get_flow(self.else_, failed) if self.else_ else Flow(failed, {}, None))
        failures = {failure: end for branch in branches for failure, end in branch.failures.items()}
        return Flow(
            join_states(branch.success for branch in branches),
            failures,
            join_states(branch.halted for branch in branches),
        )

    @property
    def counterpart(self) -> Counterpart | None:
        """`IfThenElse` of BehaviorTree.CPP; None without `else`, because a failed condition fails there."""
        return Counterpart("IfThenElse") if self.else_ else None

    class Behaviour(NodeBehaviour):
        """Runs the node."""

        node: If

        def start(self) -> None:
            """Check the condition, and choose the branch."""
            is_true = self.tick_child(self.node.holds) is Status.SUCCESS
            self._branch = self.node.then if is_true else self.node.else_
            cause = None if is_true else self.get_failure(self.node.holds)
            self.report_choice("then" if is_true else "else", cause)

        def step(self) -> Status:
            """Continue the chosen branch."""
            if self._branch is None:
                return Status.SUCCESS
            status = self.await_child(self._branch)
            return self.fail(self.get_failure(self._branch)) if status is Status.FAILURE else status


class SetVariable(ControlNode):
    """Give a variable of the mission a new value.

    The key `variables` of the mission or of a subtree declares the variable, its type and its first value.

    * BehaviorTree.CPP: `SetBlackboard`, or a `Script`.
    * py_trees: `SetBlackboardVariable`, with a constant.
    """

    keyword = "set"
    symbol = ":="

    declaration: object = None
    """Declaration of the variable, in the node that sets the first value; otherwise None."""
    set: VariableName = key(shorthand=True, doc="Name of the variable, without `$`.")
    to: AnyValue = key(sibling=True, doc="New value: a constant, or an expression such as `= $n + 1`.")

    @property
    def detail(self) -> str:
        """The variable and its new value."""
        return f"${self.set.rpartition('.')[2]} = {self.settings['to']}"

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return success, after which the variable is written."""
        del get_flow
        return Flow(state.with_variables([self.set]), {}, None)

    class Behaviour(NodeBehaviour):
        """Runs the node."""

        node: SetVariable

        def step(self) -> Status:
            """Evaluate the value, and write it."""
            value = self.scope.evaluate(self.node.settings["to"])
            self.blackboard[self.node.set] = value
            self.report_choice(f"${self.node.set.rpartition('.')[2]} = {value}")
            return Status.SUCCESS


class Fail(ControlNode):
    """Fail with a message; handlers name the failure by the label of the node: `fail.too_few`.

    Without a label, the failure is `fail.failed`. Braces in the message contain expressions.

    * BehaviorTree.CPP: `AlwaysFailure`, which has no message.
    * py_trees: `Failure`, which has no message.
    """

    keyword = "fail"
    symbol = "✗"
    reasons: ClassVar[tuple[str, ...]] = ("failed",)

    fail: Expression = key(shorthand=True, is_template=True, doc="Message: `only {$items.count} are left`.")

    @property
    def own_reasons(self) -> tuple[str, ...]:
        """The label, or `failed`."""
        return (self.label or "failed",)

    @property
    def detail(self) -> str:
        """The message."""
        return str(self.fail)

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the failure."""
        del get_flow
        return Flow(None, {PossibleFailure(self.keyword, self.own_reasons[0], self.path): state}, None)

    class Behaviour(NodeBehaviour):
        """Runs the node."""

        node: Fail

        def step(self) -> Status:
            """Fail with the message."""
            return self.fail_with_reason(self.node.own_reasons[0], str(self.scope.evaluate(self.node.fail)))


class Finish(ControlNode):
    """End the mission with success; open items are skipped with the given reason.

    Nodes that run at this time are halted, so that no `finally` runs, and the arm brakes. Rejected and lost
    items still count, and an object in the tool is rejected.

    * BehaviorTree.CPP: no counterpart.
    * py_trees: no counterpart.
    """

    keyword = "finish"
    symbol = "■"
    ends_mission = True

    finish: Expression = key(shorthand=True, is_template=True, doc="Reason why open items are skipped.")

    @property
    def detail(self) -> str:
        """The reason."""
        return str(self.finish)

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return no outcome, because no node runs after this one."""
        del get_flow, state
        return Flow(None, {}, None)

    class Behaviour(NodeBehaviour):
        """Runs the node."""

        node: Finish

        def step(self) -> Status:
            """End the mission.

            Raises:
                Finished: Always.
            """
            reason = str(self.scope.evaluate(self.node.finish))
            self.report_choice(reason)
            self._end(Status.SUCCESS)
            raise Finished(reason)
