"""Events of the nodes of the behaviour tree."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, TypeAlias

from pydantic import Field, JsonValue

from executive.events.event import Event

NodeStatus: TypeAlias = Annotated[str, Field(pattern="^(SUCCESS|FAILURE|INVALID)$")]


@dataclass(frozen=True)
class NodeStarted(Event):
    """A node of the tree was started.

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
        status: Final status; INVALID if the node was halted or raised a fault.
        skill: Name of the skill; "" for a control node.
        item: Item on which the skill worked, or "".
        reason: Reason of a failure, for instance `missed` for a skill, `Grasp.missed` for a control node;
            `fault` for a fault of a skill; "" otherwise.
        message: Message of the failure or fault, or "".
        origin: Path of the node that caused the failure of a control node, or "".
        outputs: Values of the outputs of a skill that succeeded, otherwise None.
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
    """A control node decided which child it runs next.

    Attributes:
        node: Path of the control node.
        choice: Description of the decision.
        reason: Failure that caused the decision, for instance `Grasp.missed`, or "".
        message: Message of this failure, or "".
    """

    node: str
    choice: str
    reason: str = ""
    message: str = ""
