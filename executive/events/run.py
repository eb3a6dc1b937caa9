"""Events of a whole run: start, requests of the operator, halt, resumption, faults and end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, TypeAlias

from pydantic import Field, JsonValue

from executive.events.event import Event

JOURNAL_FORMAT = 2
"""Version of the format of journals; format 1 stated no version."""

RunStatus: TypeAlias = Annotated[str, Field(pattern="^(SUCCESS|INCOMPLETE|FAILURE|FAULT|HALTED)$")]


@dataclass(frozen=True)
class RunStarted(Event):
    """A run began.

    Attributes:
        mission: Name of the mission.
        file: Path of the mission file.
        seed: Seed of all random numbers.
        params: Values of the params of the mission.
        overrides: Params as given on the command line.
        requests: Scripted answers of the operator; None if a person answers.
        base: Folder of the cell file.
        step: Length of a control step [s].
        versions: Versions of this project, Python, the machine and the required packages.
        format: Version of the format of the journal.
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
    """The run waits for a request of the operator.

    Attributes:
        choices: Classes that can be requested.
    """

    choices: Sequence[str]


@dataclass(frozen=True)
class RequestGiven(Event):
    """The operator gave a request.

    Attributes:
        wanted: The class, `rescan`, or None to quit.
    """

    wanted: str | None


@dataclass(frozen=True)
class RunHalted(Event):
    """The tick loop ended, and the arm begins to brake.

    Attributes:
        ticked: True if the tree was ticked in this control step.
    """

    ticked: bool


@dataclass(frozen=True)
class RunResumed(Event):
    """An interrupted run was resumed.

    Attributes:
        ticked: Number of control steps before the interruption that remain valid.
        intent: Last action of the tool before the interruption, `open` or `close`; "" if there was none;
            `unknown` if arm or tool did more than the journal knows.
        versions: Versions of this project, Python, the machine and the required packages.
    """

    ticked: int
    intent: str
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
    """A run ended, and its arm is at rest.

    Attributes:
        status: `SUCCESS`; `INCOMPLETE` if the tree succeeded and items were rejected; `FAILURE`, `FAULT` or
            `HALTED`.
        reason: Reason of the failure, for instance `Transit.dropped`; "" on success.
        message: One sentence with the measured values that explain the status, or "".
        node: Path of the node that determined the status, or "".
        empty: True if the ledger believed that no object with a route was left, and no look had shown a label
            that the cell does not know.
        holds: Item that the tool holds, `something` if the ledger knows no such item, or "".
        ticks: Number of control steps.
        robot_time: Time on the clock of the run [s].
    """

    status: RunStatus
    reason: str
    message: str
    node: str
    empty: bool
    holds: str
    ticks: int
    robot_time: float
