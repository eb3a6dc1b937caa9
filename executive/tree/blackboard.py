"""Blackboard: the variables of one run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping


class Blackboard(Mapping[str, object]):
    """The variables of one run by name; skills read inputs at their start and write outputs on success.

    Every run has its own blackboard, so that one process can execute several missions. All subtrees share
    the blackboard. Arguments of subtrees are not variables: they are substituted before the tree is built.
    """

    def __init__(self) -> None:
        self._values: dict[str, object] = {}

    def __getitem__(self, name: str) -> object:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def write(self, values: Mapping[str, object]) -> None:
        """Set variables; `values` maps their names to their new values."""
        self._values.update(values)

    def remove(self, name: str) -> None:
        """Remove a variable, if it exists."""
        self._values.pop(name, None)
