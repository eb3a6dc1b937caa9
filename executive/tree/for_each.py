"""Once for each element of a list."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.cell.objects import Target
from executive.errors import Fault
from executive.tree.blackboard import Scope
from executive.tree.loop import Rounds
from executive.tree.node import Site


class ForEach(Rounds):
    """Runs its body once for each element of a list, which it finds in the variable `each`.

    The list is the one of the start: who changes it later changes nothing here. An empty list is
    success at once; None is an element like any other. A failure of the body ends it and is passed on.
    However it ends, the variable is gone afterwards.

    Args:
        site: Where it stands.
        body: What runs for each element.
        scope: Where the variables are.
        each: Name of the variable written before every round.
        source: Name of the variable that holds the list, or the elements themselves.
    """

    word = "for_each"

    def __init__(
        self, site: Site, body: Behaviour, scope: Scope, each: str, source: str | Sequence[Any]
    ) -> None:
        super().__init__(site, [body])
        self._body, self._scope, self._each, self._source = body, scope, each, source

    @property
    def detail(self) -> str:
        """Which variable, and where its values are from."""
        source = self._source
        shown = f"${source}" if isinstance(source, str) else f"[{', '.join(map(str, source))}]"
        return f"${self._each} in {shown}"

    def start(self) -> None:
        """Take the list and its first element.

        Raises:
            Fault: The variable was never written, or holds no list.
        """
        super().start()
        self._elements, self._done = self._listed(), 0
        if self._elements:
            self._hand_out()

    def step(self) -> Status:
        """Tick the body; go on to the next element in the same tick if this one took time."""
        while self._done < len(self._elements):
            status = self.run_round(self._body)
            if status is Status.RUNNING:
                return status
            if status is Status.FAILURE:
                return self.fail(self.failure_of(self._body))
            self._done += 1
            if self._done == len(self._elements):
                break
            self._hand_out()
            if not self.next_round():
                return Status.RUNNING
        return Status.SUCCESS

    def clean_up(self) -> None:
        """Remove the variable."""
        self._scope.forget(self._each)

    def _hand_out(self) -> None:
        element = self._elements[self._done]
        self._scope.write({self._each: element})
        self.choose(f"element {self._done + 1} of {len(self._elements)}: {_named(element)}")

    def _listed(self) -> tuple[Any, ...]:
        source = self._source
        if not isinstance(source, str):
            return tuple(source)
        if source not in self._scope:
            raise Fault(
                f"{self.name}: it reads ${source}, which nothing has written yet; "
                f"written so far: {', '.join(self._scope) or 'nothing'}",
                self.path,
            )
        value = self._scope[source]
        if not isinstance(value, list | tuple):
            raise Fault(
                f"{self.name}: ${source} holds a {type(value).__name__}, not a list; "
                "go through a variable that holds one, or write the elements in the mission",
                self.path,
            )
        return tuple(value)


def _named(element: Any) -> str:
    if isinstance(element, Target):
        return element.item
    plain = element is None or isinstance(element, str | int | float)
    return str(element) if plain else type(element).__name__
