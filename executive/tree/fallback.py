"""Control node that tries alternatives in order."""

from __future__ import annotations

from collections.abc import Iterator

from py_trees.common import Status

from executive.tree.inspection import PropagatedFailure
from executive.tree.keys import Child, Children, key
from executive.tree.ordered import OrderedNode


class Fallback(OrderedNode):
    """Run the children in order until a child succeeds; fail with the failure of the last child.

    With memory, a child that failed is not run again. Without memory, every tick begins with the first child
    again: children that have failed are tried again while a later child runs, and the later child is halted
    if one of them succeeds or returns RUNNING.

    * BehaviorTree.CPP: `Fallback`; without memory `ReactiveFallback`. Here, children are never skipped.
      The checker warns if two children can return RUNNING, unless the first of them may fail in its first
      tick. BehaviorTree.CPP makes no exception and can throw an error during the run.
    * py_trees: `Selector(memory=True)` or `Selector(memory=False)`. There, a fallback may be empty.
    """

    keyword = "fallback"
    symbol = "?"
    continue_status = Status.FAILURE
    unreachable_reason = "an earlier child never fails"

    do: Children = key(shorthand=True, doc="Alternatives, in order.")

    def on_child_change(self, index: int) -> None:
        """Report the number of the next child, and the failure of the child before it."""
        if index > 0:
            failure = self.get_failure(self.do[index - 1])
            self.report_choice(f"choice {index + 1} of {len(self.do)}", failure)

    def explain(self, failure: PropagatedFailure) -> str:
        """Return the cause of a failure: all children failed. The text contains the handled failures."""
        causes = ", ".join(f"{name} ({message})" for name, message in failure.last_messages.items())
        earlier_failures = f"; the earlier ones failed with {causes}" if causes else ""
        return f"all {len(self.do)} choices failed{earlier_failures}"

    def list_contingencies(self) -> Iterator[tuple[str, Child]]:
        """Yield all children except the first, with the names `choice 2`, `choice 3`, …."""
        for number, child in enumerate(self.do[1:], 2):
            yield f"choice {number}", child
