"""Loop over the elements of a list."""

from __future__ import annotations

from typing import ClassVar

from py_trees.common import Status

from executive.cell.objects import Target
from executive.errors import Fault
from executive.tree.flow import Flow, FlowFunction, FlowState, find_fixed_point, join_states
from executive.tree.inspection import MinTimeFunction, PropagatedFailure
from executive.tree.keys import Child, Elements, VariableName, key
from executive.tree.loop import Loop


class ForEach(Loop):
    """Run the body once for every element of a list, in order.

    The node reads the list when it starts; an empty list is success at once. None is an ordinary element. A
    failure of the body ends the loop and is passed on. The variable `each` is removed at the end.
    """

    keyword = "for_each"
    keyword_hints: ClassVar = {"for": "It is called for_each here."}
    symbol = "∀"

    each: VariableName = key(list_key="in", doc="Variable that holds the current element.")
    in_: Elements = key(doc="List, or variable that holds a list.")
    do: Child = key(doc="Body of the loop.")

    @property
    def detail(self) -> str:
        """The variable and its list as a text."""
        source = self.in_
        elements = f"${source}" if isinstance(source, VariableName) else f"[{', '.join(map(str, source))}]"
        return f"${self.each} in {elements}"

    def start(self) -> None:
        """Read the list and its first element.

        Raises:
            Fault: The variable with the list was never written, or its value is not a list.
        """
        super().start()
        self._elements, self._next = self._read_list(), 0
        if self._elements:
            self._write_element()

    def step(self) -> Status:
        """Tick the body; take the next element in the same tick if the iteration took at least one tick."""
        while self._next < len(self._elements):
            status = self.run_iteration(self.do)
            if status is Status.RUNNING:
                return status
            if status is Status.FAILURE:
                return self.fail(self.get_failure(self.do))
            self._next += 1
            if self._next == len(self._elements):
                break
            self._write_element()
            if not self.begin_iteration():
                return Status.RUNNING
        return Status.SUCCESS

    def clean_up(self) -> None:
        """Remove the variable that holds the current element."""
        self.blackboard.remove(self.each)

    def _write_element(self) -> None:
        element = self._elements[self._next]
        self.blackboard.write({self.each: element})
        self.report_choice(f"element {self._next + 1} of {len(self._elements)}: {_describe_element(element)}")

    def _read_list(self) -> tuple[object, ...]:
        source = self.in_
        if not isinstance(source, VariableName):
            return source
        if source not in self.blackboard:
            raise Fault(
                f"{self.name}: it reads ${source}, which no node has written yet; "
                f"written so far: {', '.join(self.blackboard) or 'nothing'}",
                self.path,
            )
        value = self.blackboard[source]
        if not isinstance(value, list | tuple):
            raise Fault(
                f"{self.name}: ${source} holds a {type(value).__name__}, not a list; "
                "name a variable that holds a list, or write the elements in the mission",
                self.path,
            )
        return tuple(value)

    def compute_flow(self, flow_of: FlowFunction, state: FlowState) -> Flow:
        """Return the possible ends: the body is entered until its entry states reach a fixed point."""
        if self.in_ == ():
            return Flow(state, {}, None)
        is_known = not isinstance(self.in_, VariableName)
        body, entry = find_fixed_point(
            flow_of, self.do, state.with_variables([self.each]), lambda flow: flow.success
        )
        success = join_states((body.success, None if is_known else state))
        failures = {failure: after.without_variable(self.each) for failure, after in body.failures.items()}
        # The loop may wait for the next tick before it enters the body, and can be halted then.
        halted = join_states((body.halted, entry))
        return Flow(
            success and success.without_variable(self.each),
            failures,
            halted and halted.without_variable(self.each),
        )

    def min_time(self, min_time_of: MinTimeFunction) -> float:
        """Return the minimum time of all iterations [s]; 0 if their number is unknown."""
        return 0.0 if isinstance(self.in_, VariableName) else len(self.in_) * min_time_of(self.do)

    def explain_unreachable(self, child: Child) -> str:
        """Return the cause: the list is empty."""
        del child
        return "the body runs 0 times"

    def explain(self, failure: PropagatedFailure) -> str:
        """Return a text with the element at which the body failed."""
        return f"failed at {failure.last_choice}"


def _describe_element(element: object) -> str:
    """Return a short text for an element: the item of a target, a plain value, or the name of the type."""
    if isinstance(element, Target):
        return element.item
    is_plain = element is None or isinstance(element, str | int | float)
    return str(element) if is_plain else type(element).__name__
