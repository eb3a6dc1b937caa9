"""Recorder of the inputs of a run (values that the run reads from its cell), and a cell that records them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Any, NamedTuple, TypeVar

from pydantic import JsonValue

from executive.cell.protocols import Cell, StepClock
from executive.cell.proxy import Access, intercept
from executive.errors import Stopped
from executive.events import Emit, InputRead, ToolCommanded
from executive.replay import codecs
from executive.replay.codecs import Codec

Value = TypeVar("Value")


class InputFormat(NamedTuple):
    """Name and codec of a recorded input.

    Attributes:
        name: Name in the journal; contains `{detector}` for a detector and `{0}` for the first argument.
        codec: Codec of the value.
    """

    name: str
    codec: Codec = codecs.IDENTITY


UNCHANGED_INPUTS = (
    "arm.at_rest", "arm.contact_point", "plan.ready", "tool.touching", "tool.holding", "tool.load",
    "tool.load_std", "camera.name", "camera.next_pose", "camera.sees_table",
)  # fmt: skip
"""Accesses whose results are recorded unchanged, under the name of the access."""

INPUT_FORMATS: Mapping[str, InputFormat] = {
    **{name: InputFormat(name) for name in UNCHANGED_INPUTS},
    "arm.q": InputFormat("arm.q", codecs.ARRAY),
    "arm.tool_pose": InputFormat("arm.tool_pose", codecs.POSE),
    "arm.tool_velocity": InputFormat("arm.tool_velocity", codecs.ARRAY),
    "arm.destination": InputFormat("arm.destination", codecs.ARRAY),
    "arm.collision": InputFormat("arm.met"),
    "arm.describe_unreachable": InputFormat("arm.unreachable"),
    "plan.result": InputFormat("plan", codecs.MOTION),
    "tool.holding_force": InputFormat("tool.bears"),
    "camera.scan_poses": InputFormat("camera.scan_poses", codecs.STRINGS),
    "camera.get_view_box": InputFormat("camera.area.{0}", codecs.BOX),
    "camera.capture": InputFormat("camera.frame", codecs.FRAME),
    "camera.describe_displacement": InputFormat("camera.displacement"),
    "request.ready": InputFormat("detector.{detector}.ready"),
    "request.result": InputFormat("detector.{detector}", codecs.ANSWER),
    "operator.ask": InputFormat("operator"),
    "localizer.locate": InputFormat("localizer", codecs.ARRAY),
    "localizer.localize": InputFormat("observations", codecs.OBSERVATIONS),
    "behaviours.execute": InputFormat("behaviour.{0}", codecs.BEHAVIOUR_STEP),
}
"""Format of the recorded input of each access that is not a command, by `Access.name`."""

COMMANDS = frozenset(
    {"arm.plan", "arm.plan_ahead", "arm.start", "arm.stop", "tool.close", "tool.open", "detector.request"}
)
"""Accesses that command the cell, by `Access.name`; a replay executes no command."""

RECORDED_ROLES = ("arm", "tool", "camera", "detector", "operator", "localizer", "behaviours")
"""Roles of the parts of a cell with recorded inputs; a replay needs no inputs from other parts."""

_CODEC_BY_PATTERN = {
    re.sub(r"{\w+}", "*", input_format.name): input_format.codec
    for input_format in sorted(INPUT_FORMATS.values(), key=lambda input_format: -len(input_format.name))
}
"""Codec by pattern of input names (`detector.*`), sorted from long (specific) to short patterns."""


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
    except Exception as error:
        problem = f"{type(error).__name__}: {error}"
        raise ValueError(f'"value" does not have the format of the input "{name}" ({problem})') from error


class InputRecorder:
    """Emits an event for each changed value of an input; used only in the thread of the tick loop.

    Args:
        emit: Function that emits an event.
    """

    def __init__(self, emit: Emit) -> None:
        self._emit = emit
        self._read_counts: Counter[str] = Counter()
        self._last_values: dict[str, object] = {}

    def begin_step(self) -> None:
        """Begin a control step: set the number of reads of each input to 0."""
        self._read_counts.clear()

    def read(self, name: str, query: Callable[[], Value], codec: Codec = codecs.IDENTITY) -> Value:
        """Read an input from the cell, record its value if the value has changed, and return the value.

        Args:
            name: Name of the input.
            query: Function that reads the value from the cell.
            codec: Codec of the value.

        Raises:
            Exception: The cell raised an exception; the exception is recorded and raised again.
        """
        self._read_counts[name] += 1
        read_count = self._read_counts[name]
        try:
            value = query()
        except (Exception, Stopped) as error:
            self._emit(InputRead(name, read_count, str(error), type(error).__name__))
            raise
        encoded = codec.encode(value)
        if name not in self._last_values or encoded != self._last_values[name]:
            self._last_values[name] = encoded
            self._emit(InputRead(name, read_count, encoded))
        return value


def make_recording_cell(cell: Cell, recorder: InputRecorder, clock: StepClock, emit: Emit) -> Cell:
    """Return a copy of the cell with `clock` that records its inputs and emits an event per tool command."""

    def read_and_record(access: Access) -> Any:
        if access.role == "tool" and access.name in COMMANDS:
            emit(ToolCommanded(access.member))
        name, codec = find_input_format(access)
        return recorder.read(name, access.proceed, codec)

    return replace(intercept(cell, read_and_record, RECORDED_ROLES), clock=clock)
