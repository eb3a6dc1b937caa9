"""Loop over the elements of a list."""

from __future__ import annotations

from typing import ClassVar

from py_trees.common import Status

from executive.cell.objects import Target
from executive.errors import Fault
from executive.tree.flow import Enter, Flow, FlowState, joined, loop
from executive.tree.inspection import MinTimes, PassedFailure
from executive.tree.keys import Child, Elements, Variable, key
from executive.tree.loop import Loop


class ForEach(Loop):
    """Once for every element of a list, in order.

    The list is read at the start. An empty list is success at once; None is an element like any other. A
    failure of the body ends the loop and is passed on. The variable `each` is removed at the end.
    """

    word = "for_each"
    elsewhere: ClassVar = {"for": "It is called for_each here."}
    symbol = "∀"

    each: Variable = key(element_of="in", doc="The variable that holds the element.")
    in_: Elements = key(doc="A list, or a variable that holds one.")
    do: Child = key(doc="What is done.")

    @property
    def detail(self) -> str:
        """The variable and the source of its values."""
        source = self.in_
        shown = f"${source}" if isinstance(source, Variable) else f"[{', '.join(map(str, source))}]"
        return f"${self.each} in {shown}"

    def start(self) -> None:
        """Read the list and its first element.

        Raises:
            Fault: The variable was never written, or holds no list.
        """
        super().start()
        self._elements, self._done = self._read_list(), 0
        if self._elements:
            self._write_element()

    def step(self) -> Status:
        """Tick the body; continue with the next element in the same tick if this one took time."""
        while self._done < len(self._elements):
            status = self.run_round(self.do)
            if status is Status.RUNNING:
                return status
            if status is Status.FAILURE:
                return self.fail(self.failure_of(self.do))
            self._done += 1
            if self._done == len(self._elements):
                break
            self._write_element()
            if not self.next_round():
                return Status.RUNNING
        return Status.SUCCESS

    def clean_up(self) -> None:
        """Remove the variable."""
        self.blackboard.forget(self.each)

    def _write_element(self) -> None:
        element = self._elements[self._done]
        self.blackboard.write({self.each: element})
        self.choose(f"element {self._done + 1} of {len(self._elements)}: {_name(element)}")

    def _read_list(self) -> tuple[object, ...]:
        source = self.in_
        if not isinstance(source, Variable):
            return source
        if source not in self.blackboard:
            raise Fault(
                f"{self.name}: it reads ${source}, which nothing has written yet; "
                f"written so far: {', '.join(self.blackboard) or 'nothing'}",
                self.path,
            )
        value = self.blackboard[source]
        if not isinstance(value, list | tuple):
            raise Fault(
                f"{self.name}: ${source} holds a {type(value).__name__}, not a list; "
                "go through a variable that holds one, or write the elements in the mission",
                self.path,
            )
        return tuple(value)

    def flow(self, enter: Enter, state: FlowState) -> Flow:
        """Enter the body with the variable written, as often as there are new states."""
        if self.in_ == ():
            return Flow(state, {}, None)
        is_known = not isinstance(self.in_, Variable)
        body, entry = loop(enter, self.do, state.writing([self.each]), lambda flow: flow.success)
        success = joined((body.success, None if is_known else state))
        failures = {failure: after.without_variable(self.each) for failure, after in body.failures.items()}
        # A round that takes no time is followed by a wait for the next tick.
        halted = joined((body.halted, entry))
        return Flow(
            success and success.without_variable(self.each),
            failures,
            halted and halted.without_variable(self.each),
        )

    def min_time(self, times: MinTimes) -> float:
        """Return the time of all rounds; 0 if their number is unknown."""
        return 0.0 if isinstance(self.in_, Variable) else len(self.in_) * times(self.do)

    def explain_unreachable(self, child: Child) -> str:
        """Return the cause, the length of the list."""
        del child
        return "it is done 0 times"

    def explain(self, failure: PassedFailure) -> str:
        """Return the element at which the body failed."""
        return f"failed at {failure.choice}"


def _name(element: object) -> str:
    if isinstance(element, Target):
        return element.item
    is_plain = element is None or isinstance(element, str | int | float)
    return str(element) if is_plain else type(element).__name__
