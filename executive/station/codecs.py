"""Conversion of recorded inputs to JSON and back."""

from __future__ import annotations

import base64
import contextlib
import zlib
from collections.abc import Callable, Mapping
from dataclasses import astuple, dataclass
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic_core import from_json, to_json

from executive.cell.devices import CameraImage
from executive.cell.frame import Answer, Detection, ErrorRates, Observation
from executive.cell.protocols import BehaviourStep
from executive.geometry import Array

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


def encode_image(image: CameraImage) -> dict[str, Any]:
    """Return size, time and visible pixels of an image; the journal does not contain the colours."""
    visible = None if image.visible is None else _encode_mask(image.visible)
    return {"size": list(image.colour.shape[:2]), "stamp": image.stamp, "visible": visible}


def decode_image(value: Any) -> CameraImage:
    """Return a black image of the size and the time that `encode_image` encoded, without depth."""
    height, width = value["size"]
    if not 0 < height * width <= MAX_PIXELS:
        raise ValueError(f"an image of {height} x {width} pixels")
    visible = None if value["visible"] is None else _decode_mask(value["visible"], height, width)
    return CameraImage(np.zeros((height, width, 3), np.uint8), None, value["stamp"], visible)


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
ARRAY = Codec(np.ndarray.tolist, decode_array)
IMAGE = Codec(encode_image, decode_image)
ANSWER = Codec(encode_answer, decode_answer)
OBSERVATIONS = Codec(
    lambda observations: list(map(encode_observation, observations)),
    lambda values: list(map(decode_observation, values)),
)
BEHAVIOUR_STEP = Codec(encode_behaviour_step, decode_behaviour_step)
MOTION = Codec(attrgetter("duration"), RecordedMotion)
"""Codec of planned motions; the other codecs are named after the type that they convert."""
