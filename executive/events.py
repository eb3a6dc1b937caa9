"""Events of a run: one frozen dataclass per kind of event.

The parts of a run emit events; observers (journal, trace, pictures, views) receive each event with its time.
The journal contains one JSON object per event; the keys of the object are the fields of the event class,
except fields with an empty default value.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar, Final, Literal, TypeAlias

from pydantic import ConfigDict, Field, JsonValue

from executive.errors import MAX_TEXT_LENGTH, to_text

JOURNAL_FORMAT: Final = 5
"""Version of the journal format. Runs of formats 3 and 4 have other inputs, and can only be reported."""

RunStatus: TypeAlias = Annotated[str, Field(pattern="^(SUCCESS|INCOMPLETE|FAILURE|FAULT|HALTED)$")]
"""Final status of a run; INCOMPLETE if the tree succeeded but items were rejected."""
NodeStatus: TypeAlias = Annotated[str, Field(pattern="^(SUCCESS|FAILURE|INVALID)$")]
"""Final status of a node; INVALID for a node that was halted or raised a fault."""


@dataclass(frozen=True)
class Event:
    """Base class of the events; a value of any other type becomes a text where a text is declared.

    The texts of an event may come from code of other projects, for instance the message of a failure.

    Attributes:
        is_recorded: True if events of this class are written to the journal.
    """

    is_recorded: ClassVar[bool] = True

    # With `strict`, Pydantic rejects a value of the wrong type instead of converting it.
    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(strict=True)

    _text_names: ClassVar[tuple[str, ...]] = ()
    """Names of the fields that are declared as texts."""

    def __init_subclass__(cls) -> None:
        cls._text_names = tuple(name for name, declared in cls.__annotations__.items() if declared == "str")

    def __post_init__(self) -> None:
        values = vars(self)
        for name in self._text_names:
            value = values[name]
            if type(value) is not str or len(value) > MAX_TEXT_LENGTH:
                values[name] = to_text(value)


@dataclass(frozen=True)
class TimedEvent:
    """An event and its time.

    Attributes:
        tick: Number of the control step in which the event happened.
        clock: Time on the clock of the run [s].
        event: The event.
    """

    tick: int
    clock: float
    event: Event


Emit = Callable[[Event], None]
"""Function that emits an event: adds the time, and passes the timed event to all observers."""

Observer = Callable[[TimedEvent], None]
"""Function that receives a timed event in the thread of the tick loop; it must not block."""


def discard_event(event: Event) -> None:
    """Ignore an event; serves as the `Emit` function if nobody observes the events."""


# Events of the cell and of its ledger.


@dataclass(frozen=True)
class MotionPlanned(Event):
    """A skill requested a motion, and the plan of the motion is ready.

    Attributes:
        planned_ahead: True if the motion was planned before a skill requested the motion.
        delay: Time from the request of the skill until the plan is ready [s].
        duration: Duration of the motion [s]; 0 if there is no motion.
    """

    planned_ahead: bool
    delay: float
    duration: float


@dataclass(frozen=True)
class ToolCommanded(Event):
    """The tool is about to open or close.

    Attributes:
        action: `open` or `close`.
    """

    action: str


@dataclass(frozen=True)
class InputRead(Event):
    """The run read an input of the cell whose value differs from the value of the previous reading.

    Attributes:
        name: Name of the input, for instance `tool.holding`.
        read_number: Number of the reading of the input within the control step, counted from 1.
        value: The value, or the message of the exception.
        exception: Name of the exception that the cell raised; "" for a value.
    """

    name: str
    read_number: int
    value: JsonValue
    exception: str = ""


@dataclass(frozen=True)
class FaultInjected(Event):
    """A test injected a fault into the cell.

    Attributes:
        name: Name of the injected fault.
        node: Path of the node that was running, or "".
        item: Item on which the running node works, or "".
        object: Class of the affected object, or "".
        position: Position of the affected object `(3,)` [m]; empty if no object is affected.
    """

    name: str
    node: str
    item: str
    object: str
    position: Sequence[float]


@dataclass(frozen=True)
class DetectedObject:
    """A localized detection in a frame.

    Attributes:
        label: Detected class.
        confidence: Confidence of the detector, 0 to 1.
        box: Left, top, right and bottom side [pixel].
        position: Position of the object in the world `(3,)` [m].
        contradiction: Sentence that states how size or height contradict the class, or "".
    """

    label: str
    confidence: float
    box: Annotated[Sequence[float], Field(min_length=4, max_length=4)]
    position: Annotated[Sequence[float], Field(min_length=3, max_length=3)]
    contradiction: str

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(strict=True, extra="forbid")


@dataclass(frozen=True)
class FrameSearched(Event):
    """A detector searched a frame; the ledger (known items and their states) received the detections.

    Attributes:
        frame: Number of the frame.
        camera: Name of the camera.
        detector: Name of the detector.
        view: Processed part of the frame: `table` for the workspace, `full` for the whole image.
        confident: Detections with high confidence and without a contradiction.
        doubtful: Detections with low confidence or a contradiction.
        unknown_labels: Labels of the detections whose class the cell file does not declare.
    """

    frame: int
    camera: str
    detector: str
    view: str
    confident: Sequence[DetectedObject]
    doubtful: Sequence[DetectedObject]
    unknown_labels: Sequence[str]


@dataclass(frozen=True)
class ItemChanged(Event):
    """The ledger changed an item.

    Attributes:
        item: Name of the item.
        label: Class of the item.
        state: `seen`, `held`, `dropped`, `placed`, `rejected`, `skipped`, `lost`, or `phantom` (no object).
        position: Position of the item `(3,)` [m].
        looks: Number of frames in which the item was detected.
        attempts: Number of failed attempts to pick the item.
        bin: Name of the bin into which the item was placed, or "".
        reason: Sentence that explains the state, or "".
    """

    item: str
    label: str
    state: str
    position: Annotated[Sequence[float], Field(min_length=3, max_length=3)]
    looks: int
    attempts: int
    bin: str
    reason: str


@dataclass(frozen=True)
class UnexplainedChanged(Event):
    """The ledger found, found again or explained what images or sensors show and no item explains.

    Attributes:
        name: Name, unique in the run, for instance `unexplained-1`.
        text: Sentence that describes it.
        position: Position `(3,)` [m]; empty if it has none.
        frame: Number of the last frame that shows it; 0 for none.
        box: Left, top, right and bottom side in the frame [pixel]; empty without a frame.
        is_open: False after an explanation was found, or after it disappeared.
    """

    name: str
    text: str
    position: Sequence[float]
    frame: int = 0
    box: Sequence[float] = ()
    is_open: bool = True


@dataclass(frozen=True)
class BinsEmptied(Event):
    """A person, a skill or a program declared that bins have been emptied.

    Attributes:
        bins: Names of the bins.
    """

    bins: Sequence[str]


@dataclass(frozen=True)
class TargetSelected(Event):
    """A skill selected the next item to pick.

    Attributes:
        item: Name of the item.
        label: Class of the item.
        frame: Number of the last frame in which the item was detected.
        bin: Name of the bin into which the item is to be placed.
    """

    item: str
    label: str
    frame: int
    bin: str


# Events of a run and of the nodes of its behaviour tree.


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
        cell: Cell from the command line, which replaced the cell of the mission; "" if there was none.
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
    format: Literal[3, 4, 5] = JOURNAL_FORMAT
    cell: str = ""


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
        last_command: Last command to the tool before the interruption: `open` or `close`; "" for none.
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
        is_table_empty: True if almost certainly no object that the mission still sorts is visible on the
            table, and no frame showed an unknown label.
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
        reason: Reason for the failure (`missed` for a skill, `Grasp.missed` for a control node); `fault` if
            a skill raised a fault; "" for every other status.
        message: Message of the failure or fault, or "".
        origin: Path of the node that caused the failure of a control node, or "".
        outputs: Values of the outputs by name if a skill succeeded; otherwise None.
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
