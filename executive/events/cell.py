"""Events of the cell: motions, commands of the tool, answers, and faults that a test injects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pydantic import JsonValue

from executive.events.event import Event


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
