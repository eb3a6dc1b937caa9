"""Halting a tree: every running node ends once, whatever the others do.

py_trees stops at the first exception in a `terminate`, which would leave siblings running, and calls
it on nodes that finished long ago; the executive halts with this function instead.
"""

from __future__ import annotations

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.errors import Fault


def halt(root: Behaviour) -> list[str]:
    """End every running node below and including `root`, children first; return what went wrong."""
    problems = []
    for node in root.iterate():
        if node.status is Status.RUNNING:
            try:
                node.stop(Status.INVALID)
            except Exception as error:
                where = (error.node if isinstance(error, Fault) else "") or node.name
                problems.append(f"{where}: {error}")
                # A node whose clean-up failed has ended all the same: nobody may halt it twice.
                node.status = Status.INVALID
    return problems
