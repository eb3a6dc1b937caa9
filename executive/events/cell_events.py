"""Events of the cell and of its ledger."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

from pydantic import ConfigDict, Field, JsonValue

from executive.events.event import Event


@dataclass(frozen=True)
class MotionPlanned(Event):
    """The plan of a motion that a skill requested is ready.

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
    """A detector searched a frame for objects, and the ledger received the detections.

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
