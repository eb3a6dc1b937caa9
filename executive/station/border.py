"""The border of a run: each value that enters the run from outside is recorded, or comes from a record.

Outside are the devices, the detectors and the localizer, which read images, the planner, the operator, and
the behaviours of other projects. Replays, resumed runs and injected faults stand on this border.
"""

from __future__ import annotations

import builtins
import contextlib
import re
from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import astuple, dataclass
from fnmatch import fnmatchcase
from functools import partial
from operator import attrgetter
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np
from pydantic import JsonValue
from pydantic_core import from_json, to_json

from executive import errors
from executive.cell.frame import Answer, BinAppearance, Detection, ErrorRates, Observation, Region
from executive.cell.protocols import BehaviourStep
from executive.errors import ExecutiveError, Interrupted, Stopped, to_text
from executive.events import Emit, InputRead, ToolCommanded
from executive.geometry import Array, Yaw
from executive.station.camera import decode_image, encode_image

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


def encode_detection(detection: Detection) -> list[Any]:
    """Return class, confidence, box, confidence of the second most likely class, and the outline if known."""
    box = [float(edge) for edge in detection.box]
    outline = [[[float(x), float(y)] for x, y in detection.outline]] if detection.outline else []
    return [detection.label, float(detection.confidence), box, float(detection.second_confidence), *outline]


def decode_detection(value: Any) -> Detection:
    """Return the detection that `encode_detection` encoded."""
    label, confidence, box, second_confidence, *outlines = value
    outline = tuple((x, y) for x, y in outlines[0]) if outlines else None
    return Detection(label, confidence, tuple(box), second_confidence, outline)


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
    position = seen.position.tolist()
    return [detection, position, seen.std, seen.stamp, seen.is_confident, seen.contradiction, seen.yaw]


def decode_observation(value: Any) -> Observation:
    """Return the observation that `encode_observation` encoded."""
    detection, position, std, stamp, is_confident, contradiction, yaw = value
    return Observation(
        decode_detection(detection), decode_array(position), std, stamp, is_confident, contradiction,
        yaw=yaw and Yaw(*yaw),
    )  # fmt: skip


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


IDENTITY = Codec(lambda value: value.item() if isinstance(value, np.generic) else value, lambda value: value)
"""Codec of numbers, also those of numpy, truth values, strings and None."""
NONE = Codec(lambda _: None, lambda _: None)
"""Codec of the results of commands, which a replay does not need."""
ARRAY = Codec(np.ndarray.tolist, decode_array)
IMAGE = Codec(encode_image, decode_image)
ANSWER = Codec(encode_answer, decode_answer)
OBSERVATIONS = Codec(
    lambda observations: list(map(encode_observation, observations)),
    lambda values: list(map(decode_observation, values)),
)
REGIONS = Codec(
    lambda regions: [[list(map(float, each.box)), each.position.tolist(), each.text] for each in regions],
    lambda values: [Region(tuple(box), decode_array(position), text) for box, position, text in values],
)
BINS = Codec(
    lambda bins: {name: list(appearance) for name, appearance in bins.items()},
    lambda value: {name: BinAppearance(*appearance) for name, appearance in value.items()},
)
BEHAVIOUR_STEP = Codec(encode_behaviour_step, decode_behaviour_step)
MOTION = Codec(attrgetter("duration"), RecordedMotion)
"""Codec of planned motions; the other codecs are named after the type that they convert."""

T = TypeVar("T")
"""Type of a wrapped part, or of an input."""


class Input(NamedTuple):
    """Format of a value that enters a run.

    Attributes:
        name: Name in the journal; contains `{name}` for the name of a detector and `{0}` for the first
            argument of a call.
        codec: Codec of the value.
    """

    name: str
    codec: Codec = IDENTITY


ATTRIBUTES: Mapping[str, Input] = {
    "arm.q": Input("arm.q", ARRAY),
    "arm.qd": Input("arm.qd", ARRAY),
    "arm.end_q": Input("arm.end_q", ARRAY),
    "arm.at_rest": Input("arm.at_rest"),
    "arm.collision": Input("arm.collision"),
    "arm.contact_point": Input("arm.contact_point"),
    "plan.ready": Input("plan.ready"),
    "tool.touching": Input("tool.touching"),
    "tool.holding": Input("tool.holding"),
    "tool.holding_force": Input("tool.holding_force"),
    "tool.load": Input("tool.load"),
    "tool.load_std": Input("tool.load_std"),
    "tool.opening": Input("tool.opening"),
    "request.ready": Input("detector.{name}.ready"),
}
"""Inputs that are attributes, by role and attribute."""

COMMAND = Input("command", NONE)
"""Format of the result of a command; a replay executes no command."""

METHODS: Mapping[str, Input] = {
    "arm.execute": COMMAND,
    "arm.stop": COMMAND,
    "planner.plan": COMMAND,
    "planner.plan_ahead": COMMAND,
    "plan.result": Input("plan", MOTION),
    "tool.close": COMMAND,
    "tool.open": COMMAND,
    "image.capture": Input("camera.image", IMAGE),
    "camera.sees_table": Input("camera.sees_table"),
    "camera.find_faults": Input("camera.faults"),
    "camera.find_unexplained": Input("camera.regions", REGIONS),
    "camera.inspect_bins": Input("camera.bins", BINS),
    "detector.request": COMMAND,
    "request.result": Input("detector.{name}", ANSWER),
    "operator.ask": Input("operator"),
    "localizer.locate": Input("localizer", ARRAY),
    "localizer.localize": Input("observations", OBSERVATIONS),
    "behaviours.execute": Input("behaviour.{0}", BEHAVIOUR_STEP),
}
"""Inputs and commands that are methods, by role and method."""

RETURNED_ROLES = {"planner.plan": "plan", "detector.request": "request"}
"""Role of the object that a command returns."""

_CODEC_BY_PATTERN = {
    re.sub(r"{\w+}", "*", entry.name): entry.codec
    for entry in sorted((*ATTRIBUTES.values(), *METHODS.values()), key=lambda entry: -len(entry.name))
}
"""Codec by pattern of input names (`detector.*`), sorted from long (specific) to short patterns."""


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


class RecordedInput(NamedTuple):
    """Event with a value that entered a run, and number of the tick in which the run read the value."""

    tick: int
    reading: InputRead


class InputNotRecorded(errors.Fault):
    """The replayed run reads an input that the recorded run had not read up to this tick."""


@dataclass(frozen=True)
class Access:
    """One read of an attribute, or one call of a method, of a wrapped part.

    Attributes:
        role: Role of the part: `arm`, `tool`, `detector`, `request`, ...
        name: Name of the detector for the roles `detector` and `request`, otherwise "".
        member: Name of the attribute or method.
        proceed: Function that performs the access on the part itself and returns the result.
        arguments: Positional arguments of the call, then the values of its keyword arguments; () for an
            attribute.
        is_call: True for the call of a method, False for the read of an attribute.
    """

    role: str
    name: str
    member: str
    proceed: Callable[[], Any]
    arguments: tuple[Any, ...] = ()
    is_call: bool = True

    @property
    def path(self) -> str:
        """Role and member, for instance `arm.execute`."""
        return f"{self.role}.{self.member}"


class Border:
    """Reads each input of a run from its source and records changed values, or replays recorded values.

    Args:
        emit: Function that receives an event for each changed value and each command to the tool.

    Attributes:
        tick: Number of the current tick, which the run sets.
        is_live: True if values come from outside; False during a replay.
        interceptor: Function that handles each access to the outside, for injected faults and tests; by
            default `Access.proceed`.
        missing_input_message: Message about the first input without a recorded value, or "".
    """

    def __init__(self, emit: Emit) -> None:
        self.tick = 0
        self.is_live = True
        self.interceptor: Callable[[Access], Any] | None = None
        self.missing_input_message = ""
        self._emit = emit
        self._inputs: dict[str, deque[RecordedInput]] = {}
        self._counted_tick = 0
        self._read_counts: Counter[str] = Counter()
        self._last_values: dict[str, Any] = {"bins_emptied": []}

    def replay(self, inputs: Mapping[str, Iterable[RecordedInput]]) -> None:
        """Return recorded values by name of the input, in order, until `is_live` is set again."""
        self.is_live = False
        self._inputs = {name: deque(entries) for name, entries in inputs.items()}
        # The journal of a killed run may contain no value of the clock; every clock starts at 0.
        self._last_values |= {"clock": 0.0}

    def wrap(self, role: str, part: T, name: str = "") -> T:
        """Return a part of the outside with recorded inputs; in a replay, `part` may be None."""
        return cast(T, Recorded(self, role, part, name))

    def handle(self, access: Access) -> Any:
        """Return the result of an access to a wrapped part."""
        path = access.path
        entry = METHODS.get(path) if access.is_call else ATTRIBUTES.get(path)
        proceed = access.proceed if self.interceptor is None else partial(self.interceptor, access)
        if entry is None:
            return proceed()
        if access.role == "tool" and entry is COMMAND:
            self._emit(ToolCommanded(access.member))
        return self.read(entry.name.format(*access.arguments, name=access.name), proceed, entry.codec)

    def read(self, name: str, query: Callable[[], T], codec: Codec = IDENTITY) -> T:
        """Return the value of an input: from `query`, recorded if it has changed, or from the record.

        Raises:
            Exception: `query` raised an exception, which is recorded and raised again; or the recorded read
                raised an exception with the same class name and message.
            InputNotRecorded: The recorded run had not read this input up to this tick.
        """
        if self._counted_tick != self.tick:
            self._counted_tick = self.tick
            self._read_counts.clear()
        self._read_counts[name] += 1
        read_count = self._read_counts[name]
        if not self.is_live:
            value: T = codec.decode(self._replay(name, read_count))
            return value
        try:
            value = query()
            # Most values are read in every tick and need no conversion.
            is_encoded = codec is IDENTITY and not isinstance(value, np.generic)
            encoded: Any = value if is_encoded else codec.encode(value)
        except Interrupted:
            raise
        except BaseException as error:
            self._emit(InputRead(name, read_count, to_text(error), type(error).__name__))
            raise
        if name not in self._last_values or encoded != self._last_values[name]:
            self._last_values[name] = encoded
            self._emit(InputRead(name, read_count, encoded))
        return value

    def _replay(self, name: str, read_count: int) -> Any:
        """Return the recorded JSON value of an input."""
        inputs = self._inputs.get(name, deque())
        # Process all recorded values up to and including this read, in the order of their reads.
        this_read = (self.tick, read_count)
        while inputs and (inputs[0].tick, inputs[0].reading.read_number) <= this_read:
            reading = inputs.popleft().reading
            if reading.exception:
                raise _make_exception(reading)
            self._last_values[name] = reading.value
        if name not in self._last_values:
            message = f"the replay reads {name} in step {self.tick}, but the journal has no earlier value"
            self.missing_input_message = self.missing_input_message or message
            raise InputNotRecorded(message)
        return self._last_values[name]


def _make_exception(reading: InputRead) -> BaseException:
    """Return an exception with the recorded class name and message; an unknown class is created."""
    name = reading.exception
    candidates: tuple[Any, ...] = (getattr(errors, name, None), getattr(builtins, name, None), Exception)
    known = next(each for each in candidates if isinstance(each, type) and issubclass(each, BaseException))
    if issubclass(known, ExecutiveError | Stopped):
        return known(str(reading.value))
    base = Exception if issubclass(known, Exception) else BaseException
    return type(name, (base,), {})(reading.value)


class Recorded:
    """A part of the outside, whose attributes and methods go through a border.

    Members that are neither inputs nor commands go through the border, too, but are not recorded.
    """

    def __init__(self, border: Border, role: str, part: Any, name: str) -> None:
        self._border = border
        self._role = role
        self._part = part
        self._name = name
        self._attributes: dict[str, Access] = {}
        """Accesses by attribute, stored because some attributes are read in every tick."""

    def __getattr__(self, member: str) -> Any:
        if member.startswith("_"):
            # `copy` reads private names before `_role` has a value.
            raise AttributeError(f"{type(self).__name__} has no attribute {member!r}")
        if (access := self._attributes.get(member)) is not None:
            return self._border.handle(access)
        path = f"{self._role}.{member}"
        if path not in ATTRIBUTES and (path in METHODS or callable(getattr(self._part, member))):
            return partial(self._call, member)
        proceed = partial(getattr, self._part, member)
        access = Access(self._role, self._name, member, proceed, is_call=False)
        self._attributes[member] = access
        return self._border.handle(access)

    def _call(self, member: str, /, *arguments: Any, **keywords: Any) -> Any:
        def proceed() -> Any:
            return getattr(self._part, member)(*arguments, **keywords)

        access = Access(self._role, self._name, member, proceed, (*arguments, *keywords.values()))
        result = self._border.handle(access)
        if returned_role := RETURNED_ROLES.get(access.path):
            return self._border.wrap(returned_role, result, self._name)
        return result
