"""Control node that runs its children in order."""

from __future__ import annotations

from py_trees.common import Status

from executive.tree.keys import Child, Children, key
from executive.tree.ordered import OrderedNode


class Sequence(OrderedNode):
    """Run the children in order; fail with the first failure.

    Without memory, every tick begins with the first child again: children that have succeeded are checked
    again while a later child runs, and the later child is halted if one of them fails or returns RUNNING.

    * BehaviorTree.CPP: `Sequence`; without memory `ReactiveSequence`. Here, children are never skipped.
      The checker warns if two children can return RUNNING, unless the first of them may succeed in its first
      tick. BehaviorTree.CPP makes no exception and can throw an error during the run.
    * py_trees: `Sequence(memory=True)` or `Sequence(memory=False)`. There, a sequence may be empty.
    """

    keyword = "sequence"
    symbol = "→"
    continue_status = Status.SUCCESS
    unreachable_reason = "an earlier child never succeeds"

    do: Children = key(shorthand=True, doc="Nodes to run, in order.")

    @property
    def first_child(self) -> Child | None:
        """The first child, which runs once; None without memory, because each tick runs the child again."""
        return self.do[0] if self.memory else None
