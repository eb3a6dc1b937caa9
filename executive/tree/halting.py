"""Function that halts a tree: it stops every running node once, even if the clean-up of a node fails.

The function `halt` replaces the `stop` of py_trees, because `stop` also calls `terminate` of nodes that have
ended, and leaves nodes running after the first exception of a `terminate`.
"""

from __future__ import annotations

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.errors import Fault


def halt(root: Behaviour) -> list[str]:
    """Stop every running node of the tree `root`, children first; return the messages of failed clean-ups."""
    problems = []
    for node in root.iterate():
        if node.status is Status.RUNNING:
            try:
                node.stop(Status.INVALID)
            except Exception as error:
                node_name = (error.node if isinstance(error, Fault) else "") or node.name
                problems.append(f"{node_name}: {error}")
                # A node whose clean-up failed counts as ended: no node is halted twice.
                node.status = Status.INVALID
    return problems
