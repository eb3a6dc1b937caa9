"""Loops, and the base class of control nodes whose decisions are written as a generator."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from typing import TypeAlias, cast

from py_trees.common import Status

from executive.cell.objects import Target
from executive.errors import Fault
from executive.skill import ANY, EMPTY, HOLDING
from executive.text.findings import Finding, make_error
from executive.tree.blackboard import Failure
from executive.tree.flow import Flow, FlowFunction, FlowState, find_fixed_point, join_states
from executive.tree.keys import Elements, key
from executive.tree.node import ControlNode, Counterpart, NodeAnalysis, PropagatedFailure
from executive.tree.specification import (
    Child,
    Expression,
    Node,
    Reason,
    Reference,
    VariableName,
    format_reasons,
)
from executive.tree.tree_node import NodeBehaviour

NodeRun: TypeAlias = Generator[Node | None, None, Failure | None]
"""Generator that returns a failure, or None for success. A `yield` ends the tick."""


class GeneratorBehaviour(NodeBehaviour):
    """Base class of behaviours that run one child after the other, in the order of a generator `run`.

    A subclass implements `run` in place of `start` and `step`. In a loop, the iteration after an iteration
    that took only one tick begins in the next tick, so that a loop never blocks a tick. After a longer
    iteration, the next iteration begins in the same tick.
    """

    def start(self) -> None:
        """Begin a new generator."""
        self._run = self.run()
        self._has_tick_passed = False

    def step(self) -> Status:
        """Continue the generator."""
        try:
            if next(self._run) is None:
                # `run` decides in every tick, for instance with a loop over `run_child` of a running child.
                self._awaited.clear()
        except StopIteration as end:
            failure = cast("Failure | None", end.value)
            return Status.SUCCESS if failure is None else self.fail(failure)
        self._has_tick_passed = True
        return Status.RUNNING

    def clean_up(self) -> None:
        """Close the generator, so that its `finally` blocks are executed after a halt, too."""
        self._run.close()

    def run(self) -> NodeRun:
        """Run the node from its start to its end."""
        raise NotImplementedError

    def run_child(self, child: Node) -> NodeRun:
        """Tick a child once per tick until its end, and return its failure; None after success."""
        while (status := self.await_child(child)) is Status.RUNNING:
            yield child
        return self.get_failure(child) if status is Status.FAILURE else None

    def end_iteration(self) -> NodeRun:
        """End an iteration; wait for the next tick if the iteration took only one tick."""
        if not self._has_tick_passed:
            yield None
        self._has_tick_passed = False
        return None


class While(ControlNode):
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

    def check(self, analysis: NodeAnalysis) -> Iterator[Finding]:
        """Yield an error if the loop never ends because its condition cannot fail."""
        condition = analysis.get_flow(self.condition)
        if condition is not None and not condition.failures and not analysis.is_halted_by_sibling:
            message = f"this loop never ends: its condition, {self.condition.path_name}, cannot fail"
            yield make_error(self.span, "endless", message, "Use `repeat` with `times` or `until`.")

    def explain(self, failure: PropagatedFailure) -> str:
        """Return the cause of a failure: the body, not the condition, failed."""
        return "a failure of the body ends the loop"

    class Behaviour(GeneratorBehaviour):
        """Runs the node."""

        node: While

        def run(self) -> NodeRun:
            """Run condition and body in turn until the condition or the body fails."""
            while not (failure := (yield from self.run_child(self.node.condition))):
                if body_failure := (yield from self.run_child(self.node.do)):
                    return body_failure
                yield from self.end_iteration()
            self.report_choice("done", failure)
            return None


class Repeat(ControlNode):
    """Run the body until a number of iterations, an expected failure, or a true expression ends the loop.

    Each of these three ends the loop with success. The loop evaluates the expressions before each iteration,
    and `times` before the first one; it does not interrupt an iteration. Any other failure of the body ends
    the loop and is passed on.

    * BehaviorTree.CPP: `Repeat`; with `until`, a custom node `repeat`, as failures have no reasons there.
    * py_trees: `decorators.Repeat`. Each iteration begins in a new tick, and there is no `until`.
    """

    keyword = "repeat"
    symbol = "↻"
    any_of = ("times", "until")
    unreachable_reason = "the body runs 0 times"

    times: int | None = key(default=None, ge=0, accepts_expression=True, doc="Maximum number of iterations.")
    until: tuple[Reason | Expression, ...] = key(
        default=(), doc="Failures, and expressions after `=`, that end the loop with success."
    )
    do: Child = key(doc="Body of the loop.")

    @property
    def detail(self) -> str:
        """The conditions that end the loop, as a text."""
        conditions = [] if self.times is None else [f"{self.describe_value('times')} times"]
        if self.until:
            conditions.append(f"until {format_reasons(self.until)}")
        return " or ".join(conditions)

    @property
    def expected_reasons(self) -> list[Reason]:
        """Failures that end the loop with success."""
        return [end for end in self.until if isinstance(end, Reason)]

    @property
    def ends(self) -> list[Expression]:
        """Expressions that end the loop with success."""
        return [end for end in self.until if isinstance(end, Expression)]

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the possible outcomes; the next iteration starts in the state after success of the body."""
        if self.times == 0:
            return Flow(state, {}, None)
        body, entry = find_fixed_point(
            get_flow, self.do, state, lambda body: None if self.times == 1 else body.success
        )
        reasons = self.expected_reasons
        expected_ends = [end for failure, end in body.failures.items() if failure.may_match(reasons)]
        # An expression may end the loop before the first iteration.
        may_be_empty = bool(self.ends) or isinstance(self.settings.get("times"), Expression)
        last_ends = (None if self.times is None else body.success, entry if may_be_empty else None)
        success = join_states((*expected_ends, *last_ends))
        failures = {cause: end for cause, end in body.failures.items() if not cause.matches(reasons)}
        return Flow(success, failures, join_states((body.halted, entry)))

    def check(self, analysis: NodeAnalysis) -> Iterator[Finding]:
        """Yield an error if only a count of placed items can end the loop, and the body places no item."""
        if self.expected_reasons or not self.ends or self.times is not None or analysis.is_concurrent:
            return
        skills = analysis.list_skills(self).values()
        may_place = any(
            skill is None or skill.tool_state in ((HOLDING, EMPTY), (ANY, EMPTY)) for skill in skills
        )
        if not may_place and all(_reads_only_placed(end) for end in self.ends):
            message = (
                "this loop never succeeds: its body releases no object, so `run.placed` does not increase"
            )
            hint = "Add a failure reason or `= run.elapsed >= 60` to `until`, or add `times`."
            yield make_error(self.span, "endless", message, hint)

    def explain(self, failure: PropagatedFailure) -> str:
        """Return why the loop passed on a failure of its body."""
        if self.until:
            return f"this failure is not in until ({format_reasons(self.until)})"
        return f"a failure ends the loop before its {self.describe_value('times')} iterations are complete"

    @property
    def counterpart(self) -> Counterpart | None:
        """`Repeat` of BehaviorTree.CPP; None with `until`."""
        return None if self.until else Counterpart("Repeat", {"num_cycles": "times"})

    class Behaviour(GeneratorBehaviour):
        """Runs the node."""

        node: Repeat

        def run(self) -> NodeRun:
            """Run the body until the loop is complete, or the body fails."""
            iteration_count = 0
            self._times = cast("int | None", self.read_value("times"))
            while not self._is_complete(iteration_count):
                if failure := (yield from self.run_child(self.node.do)):
                    if not failure.matches(self.node.expected_reasons):
                        return failure
                    self.report_choice("done", failure)
                    return None
                iteration_count += 1
                if not self._is_complete(iteration_count):
                    yield from self.end_iteration()
            if end := self._find_true_end():
                self.report_choice(f"done, {end}")
            return None

        def _is_complete(self, iteration_count: int) -> bool:
            """Return True if no further iteration may begin."""
            has_all = self._times is not None and iteration_count >= self._times
            return has_all or self._find_true_end() is not None

        def _find_true_end(self) -> Expression | None:
            """Return the first expression of `until` that is true, or None."""
            return next((end for end in self.node.ends if self.scope.evaluate(end)), None)


def _reads_only_placed(expression: Expression) -> bool:
    """Return True if `run.placed` is all that an expression reads."""
    operands = list(expression.walk())
    fields = [str(one) for one in operands if isinstance(one, Expression) and one.operator in ("run", "bin")]
    return set(fields) == {"run.placed"} and not any(isinstance(one, Reference) for one in operands)


class ForEach(ControlNode):
    """Run the body once for every element of a list, in order.

    The node reads the list at its start; with an empty list, the node succeeds at once. A failure of the body
    ends the loop and is passed on. At its end, the node removes the variable `each`.

    * BehaviorTree.CPP: custom node `for_each`. Its loops over queues (`LoopString`, `LoopDouble`, ...) start
      the iteration of each element in a new tick, need one more tick at the end, and keep the variable.
    * py_trees: `decorators.ForEach`. It runs the body once for an empty list, and stops at the first element
      that is None.
    """

    keyword = "for_each"
    symbol = "∀"
    unreachable_reason = "the body runs 0 times"

    each: VariableName = key(list_key="in", doc="Variable that holds the current element.")
    in_: Elements = key(doc="A list, a variable that holds a list, or `poses`, `bins`, `classes` or `items`.")
    do: Child = key(doc="Body of the loop.")

    @property
    def detail(self) -> str:
        """The variable of the current element and the list, as a text."""
        if isinstance(self.in_, VariableName):
            field = f".{self.in_.field}" if self.in_.field else ""
            return f"${self.each} in ${self.in_}{field}"
        elements = self.in_ if self.in_ == "items" else f"[{', '.join(map(str, self.in_))}]"
        return f"${self.each} in {elements}"

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the possible outcomes; the next iteration starts in the state after success of the body."""
        if self.in_ == ():
            return Flow(state, {}, None)
        entry = state.with_variables([self.each])
        body, entry = find_fixed_point(get_flow, self.do, entry, lambda body: body.success)
        # A list that is unknown before the run may be empty.
        success = join_states((body.success, None if isinstance(self.in_, tuple) else state))
        # A halt is also possible between two iterations.
        halted = join_states((body.halted, entry))
        return Flow(
            success and success.without_variable(self.each),
            {failure: end.without_variable(self.each) for failure, end in body.failures.items()},
            halted and halted.without_variable(self.each),
        )

    def explain(self, failure: PropagatedFailure) -> str:
        """Return the element at which the body failed."""
        return f"failed at {failure.last_choice}"

    class Behaviour(GeneratorBehaviour):
        """Runs the node."""

        node: ForEach

        def run(self) -> NodeRun:
            """Write each element to the variable `each` and run the body; then remove the variable.

            Raises:
                Fault: The variable with the list was never written, or its value is not a list.
            """
            elements = self._read_list()
            try:
                for number, element in enumerate(elements, 1):
                    self.blackboard[self.node.each] = element
                    self.report_choice(f"element {number} of {len(elements)}: {_describe_element(element)}")
                    if number > 1:
                        yield from self.end_iteration()
                    if failure := (yield from self.run_child(self.node.do)):
                        return failure
                return None
            finally:
                self.blackboard.pop(self.node.each, None)

        def _read_list(self) -> tuple[object, ...]:
            variable = self.node.in_
            if not isinstance(variable, VariableName):
                if variable != "items":
                    return variable
                return tuple(known.item for known in self.ledger.list_known_items() if known.is_open)
            value = self.blackboard.get(variable)
            if variable.field and value is not None:
                value = self.scope.read(variable, variable.field)
            if isinstance(value, list | tuple):
                return tuple(value)
            problem = f"it reads {self.blackboard.describe_missing(variable)}"
            if variable in self.blackboard:
                advice = "name a variable that holds a list, or write the elements in the mission"
                problem = f"${variable} holds a {type(value).__name__}, not a list; {advice}"
            raise Fault(f"{self.name}: {problem}", self.path)


def _describe_element(element: object) -> str:
    """Return a short text for an element: the item of a target, a plain value, or the name of the type."""
    if isinstance(element, Target):
        return element.item
    is_plain = element is None or isinstance(element, str | int | float)
    return str(element) if is_plain else type(element).__name__
