"""Events of the cell: planned motions, tool commands, readings of inputs, and injected faults."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pydantic import JsonValue

from executive.events.event import Event


@dataclass(frozen=True)
class MotionPlanned(Event):
    """The arm planned a motion.

    Attributes:
        planned_ahead: True if the motion was planned before a skill requested the motion.
        delay: Time from this event until the motion may start [s].
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
