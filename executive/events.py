"""Events of a run: one frozen dataclass per kind of event.

The parts of a run emit events; observers (journal, trace, pictures, views) receive each event with its time.
A journal holds one JSON object per event; its keys are the fields of these classes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar, TypeAlias

from pydantic import ConfigDict, Field, JsonValue

JOURNAL_FORMAT = 2
"""Version of the format of journals; format 1 stated no version."""

RunStatus: TypeAlias = Annotated[str, Field(pattern="^(SUCCESS|INCOMPLETE|FAILURE|FAULT|HALTED)$")]
NodeStatus: TypeAlias = Annotated[str, Field(pattern="^(SUCCESS|FAILURE|INVALID)$")]


@dataclass(frozen=True)
class Event:
    """Base of the events.

    Attributes:
        is_recorded: True if the journal holds the events of this kind.
    """

    is_recorded: ClassVar[bool] = True
    # Pydantic validates events that are read from a journal.

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(strict=True)


@dataclass(frozen=True)
class RunStarted(Event):
    """A run began.

    Attributes:
        mission: Name of the mission.
        file: Path of the mission file.
        seed: Seed of everything random.
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
class NodeStarted(Event):
    """A node of the tree was started.

    Attributes:
        node: Path of the node.
        skill: Name of the skill; "" for a control node.
        item: Item that the skill works on, or "".
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
        item: Item that the skill worked on, or "".
        reason: Reason of the failure: `missed` for a skill, `Grasp.missed` for a control node; "fault" for a
            fault of a skill; "" otherwise.
        message: Message of the failure or fault, or "".
        origin: Path of the node in which the failure of a control node began, or "".
        outputs: Values of the outputs of a skill that succeeded; None for any other end.
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
    """A control node decided what to run next.

    Attributes:
        node: Path of the control node.
        choice: The decision in words.
        reason: Failure that caused the decision, for instance `Grasp.missed`, or "".
        message: Message of this failure, or "".
    """

    node: str
    choice: str
    reason: str = ""
    message: str = ""


@dataclass(frozen=True)
class DetectedObject:
    """A localized detection in a frame.

    Attributes:
        label: Class.
        confidence: Confidence of the detector, 0 to 1.
        box: Left, top, right and bottom side [pixel].
        position: Position in the world `(3,)` [m].
        contradiction: Evidence against the class besides the detector's score, or "".
    """

    label: str
    confidence: float
    box: Sequence[float]
    position: Sequence[float]
    contradiction: str

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(strict=True, extra="forbid")


@dataclass(frozen=True)
class FrameSearched(Event):
    """A detector searched a frame, and the ledger received its detections.

    Attributes:
        frame: Number of the frame.
        camera: Name of the camera.
        detector: Name of the detector.
        view: Searched part of the frame: `table` or `full`.
        found: Confident detections.
        unsure: Detections of low confidence.
        unknown: Labels that the cell file does not declare, one for each detection.
    """

    frame: int
    camera: str
    detector: str
    view: str
    found: Sequence[DetectedObject]
    unsure: Sequence[DetectedObject]
    unknown: Sequence[str]


@dataclass(frozen=True)
class ItemChanged(Event):
    """The ledger changed an item.

    Attributes:
        item: Name of the item.
        label: Its class.
        state: `seen`, `held`, `dropped`, `placed`, `rejected`, `skipped`, `lost` or `phantom`.
        position: Its position `(3,)` [m].
        looks: Number of looks that showed the item.
        attempts: Number of failed attempts to pick it.
        bin: Bin in which it was placed, or "".
        why: Reason of the state, or "".
    """

    item: str
    label: str
    state: str
    position: Sequence[float]
    looks: int
    attempts: int
    bin: str
    why: str


@dataclass(frozen=True)
class TargetSelected(Event):
    """A skill selected the next target.

    Attributes:
        item: Name of the item.
        label: Its class.
        frame: Number of the frame that showed it last.
        bin: Bin to which it goes.
    """

    item: str
    label: str
    frame: int
    bin: str


@dataclass(frozen=True)
class MotionPlanned(Event):
    """The arm planned a motion.

    Attributes:
        ahead: True if the motion was planned before a skill asked for it.
        waits: Time until the motion may begin [s].
        duration: Duration of the motion [s]; 0 if there is none.
    """

    ahead: bool
    waits: float
    duration: float


@dataclass(frozen=True)
class ToolCommanded(Event):
    """The tool is about to be opened or closed.

    Attributes:
        action: `open` or `close`.
    """

    action: str


@dataclass(frozen=True)
class InputRead(Event):
    """The cell gave an answer that differs from its last answer to the same question.

    Attributes:
        name: Name of the input.
        nth: Number of times that the input had been read in this control step, this time included.
        value: The answer, or the message of the exception.
        raised: Name of the exception that the cell raised; "" for an answer.
    """

    name: str
    nth: int
    value: JsonValue
    raised: str = ""


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
class FaultInjected(Event):
    """A test disturbed the cell.

    Attributes:
        name: Name of the injected fault.
        node: Path of the node during which the fault was injected, or "".
        item: Item that this node works on, or "".
        object: Class of the object concerned, or "".
        position: Position of this object `(3,)` [m]; empty if there is none.
    """

    name: str
    node: str
    item: str
    object: str
    position: Sequence[float]


@dataclass(frozen=True)
class RunHalted(Event):
    """The tick loop ended; from now on the arm only brakes.

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
        traceback: Its traceback.
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


@dataclass(frozen=True)
class TimedEvent:
    """An event and its time.

    Attributes:
        tick: Control step in which the event happened.
        clock: Time on the clock of the run [s].
        event: The event.
    """

    tick: int
    clock: float
    event: Event


Emit = Callable[[Event], None]
"""Adds the time to an event and passes it to all observers."""

Observer = Callable[[TimedEvent], None]
"""Receives an event on the tick thread and returns at once."""


def ignore(event: Event) -> None:
    """Do nothing: the `emit` of a part without observers."""
