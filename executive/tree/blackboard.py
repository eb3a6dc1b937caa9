"""The blackboard (variables) of a run, the wiring of skills to it, and the context and failures of nodes."""

from __future__ import annotations

from collections import UserDict
from collections.abc import Mapping
from dataclasses import dataclass, field

from executive.cell.ledger import Ledger
from executive.cell.protocols import Clock
from executive.events import Emit, discard_event
from executive.tree.flow import PossibleFailure
from executive.tree.specification import Expression


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


@dataclass(frozen=True)
class Wiring:
    """Connections of the ports of a skill to the constants and variables of a mission.

    Attributes:
        constants: Values of params and inputs from the mission file, by the name of the param or input.
        inputs: Names of the variables from which inputs are read, by the name of the input.
        outputs: Names of the variables to which outputs are written, by the name of the output.
        fields: Fields that inputs read instead of the whole values of variables, by the name of the input.
        expressions: Expressions of params and inputs, by the name of the param or input.
    """

    constants: Mapping[str, object] = field(default_factory=dict)
    inputs: Mapping[str, str] = field(default_factory=dict)
    outputs: Mapping[str, str] = field(default_factory=dict)
    fields: Mapping[str, str] = field(default_factory=dict)
    expressions: Mapping[str, Expression] = field(default_factory=dict)

    def make_field_suffix(self, name: str) -> str:
        """Return `.label` for a port that reads the field `label` of its variable; "" for the whole value."""
        return f".{self.fields[name]}" if name in self.fields else ""
