"""The variables of one run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping


class Blackboard(Mapping[str, object]):
    """The variables of one run by name; skills read them when they start and write them when they succeed.

    One store per run, never one per process: many missions may run side by side. Subtrees share it;
    their arguments are not variables but are put in when the tree is built.
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
        """Set all these variables at once."""
        self._values.update(values)

    def forget(self, name: str) -> None:
        """Remove a variable; it need not be there."""
        self._values.pop(name, None)
