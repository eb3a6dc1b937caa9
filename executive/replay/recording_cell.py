"""Recording of the inputs of a run: values that the run reads from its cell, and their codecs."""

from __future__ import annotations

import base64
import contextlib
import re
import zlib
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import astuple, dataclass, replace
from fnmatch import fnmatchcase
from operator import attrgetter
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import JsonValue
from pydantic_core import from_json, to_json

from executive.cell.frame import Answer, Detection, ErrorRates, Frame, Observation
from executive.cell.protocols import BehaviourStep, Cell, StepClock
from executive.cell.proxy import Access, intercept
from executive.errors import Stopped
from executive.events import Emit, InputRead, ToolCommanded
from executive.geometry import Array, Pose

MAX_PIXELS = 10**8
"""Maximum number of pixels of a recorded image."""

_COLLECTION_TYPES: Mapping[str, type] = {kind.__name__: kind for kind in (tuple, set, frozenset)}
"""Types that JSON represents as a list, and that a recorded value names."""


class Codec(NamedTuple):
    """Pair of functions that convert the values of an input to JSON and back.

    Attributes:
        encode: Function that converts a value from the cell to a JSON value.
        decode: Function that converts the JSON value to the type from the cell.
    """

    encode: Callable[[Any], Any]
    decode: Callable[[Any], Any]


@dataclass(frozen=True)
class RecordedMotion:
    """Planned motion without its trajectory; a replay needs only the duration of the motion [s]."""

    duration: float


def decode_array(value: Any) -> Array:
    """Return nested lists of floats as an array."""
    return np.array(value, dtype=np.float64)


def encode_pose(pose: Pose) -> list[Any]:
    """Return the rotation matrix and the position of a pose as lists."""
    return [pose.rotation.tolist(), pose.position.tolist()]


def decode_pose(value: Any) -> Pose:
    """Return the pose that `encode_pose` encoded."""
    rotation, position = value
    return Pose(decode_array(rotation), decode_array(position))


def encode_frame(frame: Frame) -> dict[str, Any]:
    """Return the attributes of a frame, except image and depth, as a mapping."""
    return {
        "id": frame.id,
        "camera": frame.camera,
        "matrix": frame.matrix.tolist(),
        "X_WC": encode_pose(frame.X_WC),
        "stamp": frame.stamp,
        "change_count": frame.change_count,
        "visible": _encode_mask(frame.visible),
        "size": list(frame.visible.shape),
    }


def decode_frame(value: Any) -> Frame:
    """Return the frame that `encode_frame` encoded, with a black image and without depth."""
    height, width = value["size"]
    if not 0 < height * width <= MAX_PIXELS:
        raise ValueError(f"an image of {height} x {width} pixels")
    unchanged = {name: value[name] for name in ("id", "camera", "stamp", "change_count")}
    return Frame(
        **unchanged,
        image=np.zeros((height, width, 3), np.uint8),
        depth=None,
        matrix=decode_array(value["matrix"]),
        X_WC=decode_pose(value["X_WC"]),
        visible=_decode_mask(value["visible"], height, width),
    )


def encode_detection(detection: Detection) -> list[Any]:
    """Return the class, its confidence, the box and the confidence of the second most likely class."""
    box = [float(edge) for edge in detection.box]
    return [detection.label, float(detection.confidence), box, float(detection.second_confidence)]


def decode_detection(value: Any) -> Detection:
    """Return the detection that `encode_detection` encoded."""
    label, confidence, box, second_confidence = value
    return Detection(label, confidence, tuple(box), second_confidence)


def encode_answer(answer: Answer) -> dict[str, Any]:
    """Return the answer of a detector as a mapping."""
    return {
        "detector": answer.detector,
        "confident": list(map(encode_detection, answer.confident)),
        "reliability": list(astuple(answer.error_rates)),
        "doubtful": list(map(encode_detection, answer.doubtful)),
        "unknown": list(map(encode_detection, answer.unknown)),
    }


def decode_answer(value: Any) -> Answer:
    """Return the answer that `encode_answer` encoded."""
    groups = {key: tuple(map(decode_detection, value[key])) for key in ("confident", "doubtful", "unknown")}
    return Answer(value["detector"], error_rates=ErrorRates(*value["reliability"]), **groups)


def encode_observation(seen: Observation) -> list[Any]:
    """Return the attributes of an observation as a list."""
    detection = encode_detection(seen.detection)
    return [detection, seen.position.tolist(), seen.std, seen.is_confident, seen.contradiction]


def decode_observation(value: Any) -> Observation:
    """Return the observation that `encode_observation` encoded."""
    detection, position, std, is_confident, contradiction = value
    return Observation(decode_detection(detection), decode_array(position), std, is_confident, contradiction)


def encode_behaviour_step(step: BehaviourStep) -> dict[str, Any]:
    """Return the attributes of a step of a behaviour.

    Each value is in a list. The name of its type takes the place of a value that JSON cannot represent.
    """
    return step._asdict() | {"values": {name: _encode_value(value) for name, value in step.values.items()}}


def decode_behaviour_step(value: Any) -> BehaviourStep:
    """Return the step that `encode_behaviour_step` encoded, without the values that JSON cannot represent."""
    entries = {name: entry for name, entry in value["values"].items() if isinstance(entry, list)}
    values = {name: _decode_value(*entry) for name, entry in entries.items()}
    return BehaviourStep(value["status"], value["message"], values)


def _encode_value(value: object) -> list[Any] | str:
    """Return a value in a list, behind it the type if it is a collection, or only the name of its type."""
    plain_value = value.item() if isinstance(value, np.generic) else value
    content = plain_value
    type_name = type(plain_value).__name__
    # The value may be an object of another project, whose methods may raise any exception.
    with contextlib.suppress(Exception):
        if isinstance(plain_value, tuple):
            content = list(plain_value)
        elif isinstance(plain_value, set | frozenset):
            # The order of a set differs between processes.
            content = sorted(plain_value, key=repr)
        copy = from_json(to_json(content), allow_inf_nan=False)
        is_restored = type(copy) is type(content) and copy == content
        if is_restored and content is plain_value:
            return [copy]
        if is_restored and type(plain_value) is _COLLECTION_TYPES.get(type_name):
            return [copy, type_name]
    return type_name


def _decode_value(content: Any, collection_type: str = "") -> Any:
    return _COLLECTION_TYPES[collection_type](content) if collection_type else content


def _encode_mask(mask: NDArray[np.bool_]) -> str:
    """Return a mask as compressed bits in base64; "" if all pixels are True, to keep the journal short."""
    if mask.all():
        return ""
    return base64.b64encode(zlib.compress(np.packbits(mask).tobytes())).decode("ascii")


def _decode_mask(text: str, height: int, width: int) -> NDArray[np.bool_]:
    """Return the mask `(height, width)` that `_encode_mask` encoded."""
    if not text:
        return np.ones((height, width), np.bool_)
    packed_bits = np.frombuffer(zlib.decompress(base64.b64decode(text)), np.uint8)
    return np.unpackbits(packed_bits, count=height * width).reshape(height, width).astype(np.bool_)


IDENTITY = Codec(lambda value: value, lambda value: value)
"""Codec of numbers, truth values, strings and None."""
NONE = Codec(lambda _: None, lambda _: None)
"""Codec of the results of commands, which a replay does not need."""
STRINGS = Codec(list, lambda value: value)
BOX = Codec(list, tuple)
ARRAY = Codec(np.ndarray.tolist, decode_array)
POSE = Codec(encode_pose, decode_pose)
FRAME = Codec(encode_frame, decode_frame)
ANSWER = Codec(encode_answer, decode_answer)
OBSERVATIONS = Codec(
    lambda observations: list(map(encode_observation, observations)),
    lambda values: list(map(decode_observation, values)),
)
BEHAVIOUR_STEP = Codec(encode_behaviour_step, decode_behaviour_step)
MOTION = Codec(attrgetter("duration"), RecordedMotion)
"""Codec of planned motions; the other codecs are named after the type that they convert."""


Value = TypeVar("Value")


class InputFormat(NamedTuple):
    """Name and codec of a recorded input.

    Attributes:
        name: Name in the journal; contains `{detector}` for a detector and `{0}` for the first argument.
        codec: Codec of the value.
    """

    name: str
    codec: Codec = IDENTITY


UNCHANGED_INPUTS = (
    "arm.at_rest", "arm.contact_point", "plan.ready", "tool.touching", "tool.holding", "tool.load",
    "tool.load_std", "camera.name", "camera.next_pose", "camera.sees_table",
)  # fmt: skip
"""Accesses whose results are recorded unchanged, under the name of the access."""

INPUT_FORMATS: Mapping[str, InputFormat] = {
    **{name: InputFormat(name) for name in UNCHANGED_INPUTS},
    "arm.q": InputFormat("arm.q", ARRAY),
    "arm.tool_pose": InputFormat("arm.tool_pose", POSE),
    "arm.tool_velocity": InputFormat("arm.tool_velocity", ARRAY),
    "arm.destination": InputFormat("arm.destination", ARRAY),
    "arm.collision": InputFormat("arm.met"),
    "arm.describe_unreachable": InputFormat("arm.unreachable"),
    "plan.result": InputFormat("plan", MOTION),
    "tool.holding_force": InputFormat("tool.bears"),
    "camera.scan_poses": InputFormat("camera.scan_poses", STRINGS),
    "camera.get_view_box": InputFormat("camera.area.{0}", BOX),
    "camera.capture": InputFormat("camera.frame", FRAME),
    "camera.describe_displacement": InputFormat("camera.displacement"),
    "request.ready": InputFormat("detector.{detector}.ready"),
    "request.result": InputFormat("detector.{detector}", ANSWER),
    "operator.ask": InputFormat("operator"),
    "localizer.locate": InputFormat("localizer", ARRAY),
    "localizer.localize": InputFormat("observations", OBSERVATIONS),
    "behaviours.execute": InputFormat("behaviour.{0}", BEHAVIOUR_STEP),
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
        return InputFormat("command", NONE)
    name, codec = INPUT_FORMATS[access.name]
    return InputFormat(name.format(*access.arguments, detector=access.detector), codec)


def check_input(name: str, value: JsonValue) -> None:
    """Check that a recorded value of an input can be replayed.

    Raises:
        ValueError: The value does not have the format of the input.
    """
    matching_codecs = (codec for pattern, codec in _CODEC_BY_PATTERN.items() if fnmatchcase(name, pattern))
    try:
        next(matching_codecs, IDENTITY).decode(value)
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

    def read(self, name: str, query: Callable[[], Value], codec: Codec = IDENTITY) -> Value:
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
