"""The blackboard (variables) of a run, and what else the nodes of a run share: context and failures."""

from __future__ import annotations

from collections import UserDict
from dataclasses import dataclass, field

from executive.cell.protocols import Clock, Ledger
from executive.events import Emit, discard_event
from executive.tree.flow import PossibleFailure


class Blackboard(UserDict[str, object]):
    """The variables of one run by name; a skill reads inputs at its start and writes outputs on success.

    Every run has its own blackboard, so that one process can execute several missions. All subtrees share
    the blackboard. Arguments of subtrees are no variables: values replace them before the tree is built.
    """

    def describe_missing(self, variable: str) -> str:
        """Return a text about a variable that a node reads too early, for the end of a sentence."""
        return f"${variable}, which no node has written yet; written so far: {', '.join(self) or 'nothing'}"


@dataclass(frozen=True)
class Failure(PossibleFailure):
    """A failure that nodes pass on to their parents; `reason` is one of the declared reasons of its source.

    Attributes:
        message: One sentence with the measured values that explain the failure.
    """

    message: str = field(kw_only=True)


@dataclass(frozen=True)
class NodeContext:
    """Path and label of a node, and the parts of the run that the node uses.

    Attributes:
        path: Unique path from the root of the tree.
        clock: Clock of the run.
        ledger: Ledger of the run.
        blackboard: Variables of the run.
        label: Label of the node in the mission, or "".
        emit: Function that emits the events of the node.
    """

    path: str
    clock: Clock
    ledger: Ledger
    blackboard: Blackboard
    label: str = ""
    emit: Emit = discard_event
