"""Blackboard: the variables of one run."""

from __future__ import annotations

from collections import UserDict
from collections.abc import Mapping


class Blackboard(UserDict[str, object]):
    """The variables of one run by name; a skill reads inputs at its start and writes outputs on success.

    Every run has its own blackboard, so that one process can execute several missions. All subtrees share
    the blackboard. Arguments of subtrees are no variables: values replace them before the tree is built.
    """

    def write(self, values: Mapping[str, object]) -> None:
        """Set variables; `values` maps their names to their new values."""
        self.data.update(values)

    def remove(self, name: str) -> None:
        """Remove a variable, if it exists."""
        self.data.pop(name, None)
