"""Events of a run and of the nodes of its behaviour tree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, TypeAlias

from pydantic import Field, JsonValue

from executive.events.event import Event

JOURNAL_FORMAT = 3
"""Version of the journal format; journals of format 1 contain no version."""

RunStatus: TypeAlias = Annotated[str, Field(pattern="^(SUCCESS|INCOMPLETE|FAILURE|FAULT|HALTED)$")]
"""Final status of a run; INCOMPLETE if the tree succeeded but items were rejected."""
NodeStatus: TypeAlias = Annotated[str, Field(pattern="^(SUCCESS|FAILURE|INVALID)$")]
"""Final status of a node; INVALID for a node that was halted or raised a fault."""


@dataclass(frozen=True)
class RunStarted(Event):
    """A run began.

    Attributes:
        mission: Name of the mission.
        file: Path of the mission file.
        seed: Seed of all random number generators.
        params: Values of the params of the mission.
        overrides: Params from the command line.
        requests: Scripted requests of the operator; None if a person makes the requests.
        base: Folder of the cell file.
        step: Duration of a control step [s].
        versions: Versions of this project, Python, the machine and the required packages.
        format: Version of the journal format.
    """

    mission: str
    file: str
    seed: int
    params: Mapping[str, JsonValue]
    overrides: Mapping[str, str]
    requests: Sequence[str] | None
    base: str
    step: float
    versions: Mapping[str, str]
    format: int = JOURNAL_FORMAT


@dataclass(frozen=True)
class OperatorAsked(Event):
    """The run began to wait for a request of the operator.

    Attributes:
        choices: Classes that the operator can request.
    """

    choices: Sequence[str]


@dataclass(frozen=True)
class RequestGiven(Event):
    """The operator made a request.

    Attributes:
        request: The requested class; `rescan` for a new scan of the table; None to quit.
    """

    request: str | None


@dataclass(frozen=True)
class RunHalted(Event):
    """A halt ended the tick loop, and the arm starts to brake.

    Attributes:
        is_tree_ticked: True if the tree was ticked in the control step of the halt.
    """

    is_tree_ticked: bool


@dataclass(frozen=True)
class RunResumed(Event):
    """An interrupted run was resumed.

    Attributes:
        valid_ticks: Number of control steps before the interruption that are still valid.
        last_command: Last command to the tool before the interruption: `open` or `close`; "" for none;
            `unknown` if arm or tool executed commands that the journal does not contain.
        versions: Versions of this project, Python, the machine and the required packages.
    """

    valid_ticks: int
    last_command: str
    versions: Mapping[str, str]


@dataclass(frozen=True)
class FaultRaised(Event):
    """An exception ended the run.

    Attributes:
        traceback: Traceback of the exception.
    """

    traceback: str


@dataclass(frozen=True)
class RunEnded(Event):
    """A run ended; the arm is at rest.

    Attributes:
        status: Final status.
        reason: Reason of the failure, for instance `Transit.dropped`; "" on success.
        message: Sentence that explains the status, with measured values, or "".
        node: Path of the node that caused the status, or "".
        is_table_empty: True if the ledger has no object with a route, and no frame showed an unknown label.
        held_item: Item in the tool; `something` if the item is unknown; "" for an empty tool.
        ticks: Number of control steps.
        robot_time: Time on the clock of the run [s].
    """

    status: RunStatus
    reason: str
    message: str
    node: str
    is_table_empty: bool
    held_item: str
    ticks: int
    robot_time: float


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
