"""Events of the nodes of the behaviour tree."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, TypeAlias

from pydantic import Field, JsonValue

from executive.events.event import Event

NodeStatus: TypeAlias = Annotated[str, Field(pattern="^(SUCCESS|FAILURE|INVALID)$")]
"""Final status of a node; INVALID for a node that was halted or raised a fault."""


@dataclass(frozen=True)
class NodeStarted(Event):
    """A node of the tree started.

    Attributes:
        node: Path of the node.
        skill: Name of the skill; "" for a control node.
        item: Item on which the skill works, or "".
    """

    node: str
    skill: str = ""
    item: str = ""


@dataclass(frozen=True)
class NodeEnded(Event):
    """A node of the tree ended.

    Attributes:
        node: Path of the node.
        status: Final status.
        skill: Name of the skill; "" for a control node.
        item: Item on which the skill worked, or "".
        reason: Reason of a failure (`missed` for a skill, `Grasp.missed` for a control node); `fault` after
            a fault of a skill; "" for all other ends.
        message: Message of the failure or fault, or "".
        origin: Path of the node that caused the failure of a control node, or "".
        outputs: Values of the outputs of a successful skill by name; None for other nodes and ends.
    """

    node: str
    status: NodeStatus
    skill: str = ""
    item: str = ""
    reason: str = ""
    message: str = ""
    origin: str = ""
    outputs: Mapping[str, JsonValue] | None = None


@dataclass(frozen=True)
class BranchChosen(Event):
    """A control node made a decision, for instance to run another child after a failure.

    Attributes:
        node: Path of the control node.
        choice: Description of the decision.
        reason: Failure that caused the decision, for instance `Grasp.missed`, or "".
        message: Message of the failure, or "".
    """

    node: str
    choice: str
    reason: str = ""
    message: str = ""
