"""Cell whose answers are recorded, and the names and codecs of the recorded inputs."""

from __future__ import annotations

import re
import zlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from pydantic import JsonValue

from executive.cell.clock import StepClock
from executive.cell.protocols import Cell
from executive.cell.proxy import Access, intercept
from executive.events import Emit, ToolCommanded
from executive.replay.codec import (
    ANSWER,
    ARRAY,
    BOX,
    FRAME,
    MOTION,
    NOTHING,
    OBSERVATIONS,
    PLAIN,
    POSE,
    TEXTS,
    Codec,
)
from executive.replay.input_recorder import InputRecorder


class InputFormat(NamedTuple):
    """Name and codec of one kind of recorded input.

    Attributes:
        name: Name of the input in the record; `{detector}` stands for the name of the detector, `{0}` for
            the first argument.
        codec: Codec of the value.
    """

    name: str
    codec: Codec = PLAIN

    @staticmethod
    def find(access: Access) -> InputFormat:
        """Return the format of the answer to an access; all commands have the same format."""
        if access.name in COMMANDS:
            return _COMMAND
        name, codec = INPUT_FORMATS[access.name]
        if "{" in name:
            name = name.format(*access.all_arguments, detector=access.detector)
        return InputFormat(name, codec)


INPUT_FORMATS: Mapping[str, InputFormat] = {
    "arm.q": InputFormat("arm.q", ARRAY),
    "arm.tool_pose": InputFormat("arm.tool_pose", POSE),
    "arm.tool_velocity": InputFormat("arm.tool_velocity", ARRAY),
    "arm.destination": InputFormat("arm.destination", ARRAY),
    "arm.at_rest": InputFormat("arm.at_rest"),
    "arm.met": InputFormat("arm.met"),
    "plan.ready": InputFormat("plan.ready"),
    "plan.result": InputFormat("plan", MOTION),
    "tool.touching": InputFormat("tool.touching"),
    "tool.holding": InputFormat("tool.holding"),
    "tool.bears": InputFormat("tool.bears"),
    "camera.name": InputFormat("camera.name"),
    "camera.scan_poses": InputFormat("camera.scan_poses", TEXTS),
    "camera.next_pose": InputFormat("camera.next_pose"),
    "camera.area": InputFormat("camera.area.{0}", BOX),
    "camera.sees_table": InputFormat("camera.sees_table"),
    "camera.capture": InputFormat("camera.frame", FRAME),
    "camera.displacement": InputFormat("camera.displacement"),
    "request.ready": InputFormat("detector.{detector}.ready"),
    "request.result": InputFormat("detector.{detector}", ANSWER),
    "operator.ask": InputFormat("operator"),
    "localizer.locate": InputFormat("localizer", ARRAY),
    "localizer.localize": InputFormat("observations", OBSERVATIONS),
}
"""Name and codec of the recorded input of each access that is not a command, by `Access.name`."""

COMMANDS = frozenset(
    {"arm.plan", "arm.plan_ahead", "arm.start", "arm.stop", "tool.close", "tool.open", "detector.request"}
)
"""Accesses that command the cell; a replay skips them."""

RECORDED_ROLES = ("arm", "tool", "camera", "detector", "operator", "localizer")
"""Roles with recorded answers. A replay builds its own ledger; the cell file defines the other roles."""

_COMMAND = InputFormat("command", NOTHING)
"""Format of the answer to a command: None, unless the cell raises an exception."""


_PATTERNS = [
    (re.compile(re.sub(r"\\{.*?\\}", ".+", re.escape(form.name))), form.codec)
    for form in sorted(INPUT_FORMATS.values(), key=lambda form: -len(form.name))
]
"""Pattern of the input names of each format, and codec of the format; the most specific patterns first."""


def check_input(name: str, value: JsonValue) -> None:
    """Raise an error if a recorded answer cannot be replayed.

    Raises:
        ValueError: The answer does not have the format of the input.
    """
    codec = next((codec for pattern, codec in _PATTERNS if pattern.fullmatch(name)), PLAIN)
    try:
        codec.read(value)
    except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError, zlib.error) as error:
        problem = f"{type(error).__name__}: {error}"
        raise ValueError(f'"value" is no answer of the input "{name}" ({problem})') from error


def record_cell(cell: Cell, recorder: InputRecorder, clock: StepClock, emit: Emit) -> Cell:
    """Return a copy of the cell with the clock `clock` and with recorded answers.

    Each action of the tool is emitted as an event before the action.
    """

    def answer(access: Access) -> Any:
        if access.role == "tool" and access.name in COMMANDS:
            emit(ToolCommanded(access.member))
        name, codec = InputFormat.find(access)
        return recorder.read(name, access.proceed, codec)

    return replace(intercept(cell, answer, RECORDED_ROLES), clock=clock)
