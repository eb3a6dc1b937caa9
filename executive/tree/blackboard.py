"""Blackboard: the variables of one run."""

from __future__ import annotations

from collections import UserDict


class Blackboard(UserDict[str, object]):
    """The variables of one run by name; a skill reads inputs at its start and writes outputs on success.

    Every run has its own blackboard, so that one process can execute several missions. All subtrees share
    the blackboard. Arguments of subtrees are no variables: values replace them before the tree is built.
    """

    def describe_missing(self, variable: str) -> str:
        """Return a text about a variable that a node reads too early, for the end of a sentence."""
        return f"${variable}, which no node has written yet; written so far: {', '.join(self) or 'nothing'}"
