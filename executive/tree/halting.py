"""Halt of a tree: every running node is stopped once, even if the clean-up of another node fails.

py_trees stops at the first exception of a `terminate`, which leaves siblings running, and also calls the
`terminate` of nodes that have ended; the executive halts with the function `halt` instead.
"""

from __future__ import annotations

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.errors import Fault


def halt(root: Behaviour) -> list[str]:
    """End every running node of the tree `root`, children first; return the messages of failed clean-ups."""
    problems = []
    for node in root.iterate():
        if node.status is Status.RUNNING:
            try:
                node.stop(Status.INVALID)
            except Exception as error:
                place = (error.node if isinstance(error, Fault) else "") or node.name
                problems.append(f"{place}: {error}")
                # A node whose clean-up failed counts as ended: no node is halted twice.
                node.status = Status.INVALID
    return problems
