"""Cell with a recorder of its inputs, and the name and codec of each input."""

from __future__ import annotations

import re
import zlib
from collections.abc import Mapping
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Any, NamedTuple

from pydantic import JsonValue

from executive.cell.clock import StepClock
from executive.cell.protocols import Cell
from executive.cell.proxy import Access, intercept
from executive.events import Emit, ToolCommanded
from executive.replay import codecs
from executive.replay.codecs import Codec
from executive.replay.input_recorder import InputRecorder


class InputFormat(NamedTuple):
    """Name and codec of a recorded input.

    Attributes:
        name: Name in the journal; contains `{detector}` for a detector and `{0}` for the first argument.
        codec: Codec of the value.
    """

    name: str
    codec: Codec = codecs.IDENTITY


INPUT_FORMATS: Mapping[str, InputFormat] = {
    "arm.q": InputFormat("arm.q", codecs.ARRAY),
    "arm.tool_pose": InputFormat("arm.tool_pose", codecs.POSE),
    "arm.tool_velocity": InputFormat("arm.tool_velocity", codecs.ARRAY),
    "arm.destination": InputFormat("arm.destination", codecs.ARRAY),
    "arm.at_rest": InputFormat("arm.at_rest"),
    "arm.collision": InputFormat("arm.met"),
    "plan.ready": InputFormat("plan.ready"),
    "plan.result": InputFormat("plan", codecs.MOTION),
    "tool.touching": InputFormat("tool.touching"),
    "tool.holding": InputFormat("tool.holding"),
    "tool.holding_force": InputFormat("tool.bears"),
    "camera.name": InputFormat("camera.name"),
    "camera.scan_poses": InputFormat("camera.scan_poses", codecs.STRINGS),
    "camera.next_pose": InputFormat("camera.next_pose"),
    "camera.get_view_box": InputFormat("camera.area.{0}", codecs.BOX),
    "camera.sees_table": InputFormat("camera.sees_table"),
    "camera.capture": InputFormat("camera.frame", codecs.FRAME),
    "camera.describe_displacement": InputFormat("camera.displacement"),
    "request.ready": InputFormat("detector.{detector}.ready"),
    "request.result": InputFormat("detector.{detector}", codecs.ANSWER),
    "operator.ask": InputFormat("operator"),
    "localizer.locate": InputFormat("localizer", codecs.ARRAY),
    "localizer.localize": InputFormat("observations", codecs.OBSERVATIONS),
}
"""Format of the recorded input of each access that is not a command, by `Access.name`."""

COMMANDS = frozenset(
    {"arm.plan", "arm.plan_ahead", "arm.start", "arm.stop", "tool.close", "tool.open", "detector.request"}
)
"""Accesses that command the cell, by `Access.name`; a replay executes no command."""

RECORDED_ROLES = ("arm", "tool", "camera", "detector", "operator", "localizer")
"""Roles of the parts of a cell with recorded inputs; a replay needs no inputs from other parts."""

_CODEC_BY_PATTERN = {
    re.sub(r"{\w+}", "*", input_format.name): input_format.codec
    for input_format in sorted(INPUT_FORMATS.values(), key=lambda input_format: -len(input_format.name))
}
"""Codec by pattern of input names (`detector.*`); the longest pattern is first and the most specific."""


def find_input_format(access: Access) -> InputFormat:
    """Return the format of the result of an access to the cell; all commands have the name `command`."""
    if access.name in COMMANDS:
        return InputFormat("command", codecs.NONE)
    name, codec = INPUT_FORMATS[access.name]
    return InputFormat(name.format(*access.all_arguments, detector=access.detector), codec)


def check_input(name: str, value: JsonValue) -> None:
    """Check that a recorded value of an input can be replayed.

    Raises:
        ValueError: The value does not have the format of the input.
    """
    matching_codecs = (codec for pattern, codec in _CODEC_BY_PATTERN.items() if fnmatchcase(name, pattern))
    try:
        next(matching_codecs, codecs.IDENTITY).decode(value)
    except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError, zlib.error) as error:
        problem = f"{type(error).__name__}: {error}"
        raise ValueError(f'"value" does not have the format of the input "{name}" ({problem})') from error


def make_recorded_cell(cell: Cell, recorder: InputRecorder, clock: StepClock, emit: Emit) -> Cell:
    """Return a copy of the cell with recorded inputs, events of the actions of the tool, and `clock`."""

    def read_and_record(access: Access) -> Any:
        if access.role == "tool" and access.name in COMMANDS:
            emit(ToolCommanded(access.member))
        name, codec = find_input_format(access)
        return recorder.read(name, access.proceed, codec)

    return replace(intercept(cell, read_and_record, RECORDED_ROLES), clock=clock)
