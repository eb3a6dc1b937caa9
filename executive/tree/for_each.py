"""Loop over the elements of a list."""

from __future__ import annotations

from executive.cell.objects import Target
from executive.errors import Fault
from executive.tree.flow import Flow, FlowFunction, FlowState, find_fixed_point, join_states
from executive.tree.generator_node import NodeRun
from executive.tree.inspection import PropagatedFailure
from executive.tree.keys import Child, Elements, VariableName, key
from executive.tree.loop import Loop


class ForEach(Loop):
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

    def run(self) -> NodeRun:
        """Write each element of the list to the variable `each` and run the body; then remove the variable.

        Raises:
            Fault: The variable with the list was never written, or its value is not a list.
        """
        elements = self._read_list()
        try:
            for number, element in enumerate(elements, 1):
                self.blackboard[self.each] = element
                self.report_choice(f"element {number} of {len(elements)}: {_describe_element(element)}")
                if number > 1:
                    yield from self.end_iteration()
                if failure := (yield from self.run_child(self.do)):
                    return failure
            return None
        finally:
            self.blackboard.pop(self.each, None)

    def _read_list(self) -> tuple[object, ...]:
        variable = self.in_
        if not isinstance(variable, VariableName):
            if variable != "items":
                return variable
            return tuple(known.item for known in self.ledger.list_known_items() if known.is_open)
        value = self.blackboard.get(variable)
        if variable.field and value is not None:
            value = getattr(value, variable.field)
        if isinstance(value, list | tuple):
            return tuple(value)
        problem = f"it reads {self.blackboard.describe_missing(variable)}"
        if variable in self.blackboard:
            advice = "name a variable that holds a list, or write the elements in the mission"
            problem = f"${variable} holds a {type(value).__name__}, not a list; {advice}"
        raise Fault(f"{self.name}: {problem}", self.path)

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


def _describe_element(element: object) -> str:
    """Return a short text for an element: the item of a target, a plain value, or the name of the type."""
    if isinstance(element, Target):
        return element.item
    is_plain = element is None or isinstance(element, str | int | float)
    return str(element) if is_plain else type(element).__name__
