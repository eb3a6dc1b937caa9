"""Blackboard: the variables of one run."""

from __future__ import annotations

from collections import UserDict


class Blackboard(UserDict[str, object]):
    """The variables of one run by name; a skill reads inputs at its start and writes outputs on success.

    Every run has its own blackboard, so that one process can execute several missions. All subtrees share
    the blackboard. Arguments of subtrees are no variables: values replace them before the tree is built.
    """
