"""Codecs between the answers of a cell and plain values, without images and paths of motions."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from executive.cell.detection import Answer, Detection, Observation
from executive.cell.error_rates import ErrorRates
from executive.cell.frame import Frame
from executive.geometry import Array, Pose

MAX_PIXELS = 10**8
"""Maximum number of pixels of an image."""


class Codec(NamedTuple):
    """Conversions between an answer of a cell and its plain form.

    Attributes:
        write: Converts an answer to plain values.
        read: Converts plain values to an answer.
    """

    write: Callable[[Any], Any]
    read: Callable[[Any], Any]


@dataclass(frozen=True)
class RecordedMotion:
    """Recorded part of a planned motion: its duration [s]; implements `cell.arm.Motion`."""

    duration: float


def read_array(value: Any) -> Array:
    """Return an array from lists of floats."""
    return np.array(value, dtype=np.float64)


def write_pose(pose: Pose) -> list[Any]:
    """Return rotation and position of a pose as lists."""
    return [pose.rotation.tolist(), pose.position.tolist()]


def read_pose(value: Any) -> Pose:
    """Return the pose of `write_pose`."""
    rotation, position = value
    return Pose(read_array(rotation), read_array(position))


def write_frame(frame: Frame) -> dict[str, Any]:
    """Return a frame without image and depth."""
    return {
        "id": frame.id,
        "camera": frame.camera,
        "matrix": frame.matrix.tolist(),
        "X_WC": write_pose(frame.X_WC),
        "stamp": frame.stamp,
        "epoch": frame.epoch,
        "visible": _pack(frame.visible),
        "size": list(frame.visible.shape),
    }


def read_frame(value: Any) -> Frame:
    """Return the frame of `write_frame`, with a black image and without depth."""
    height, width = value["size"]
    if not 0 < height * width <= MAX_PIXELS:
        raise ValueError(f"an image of {height} x {width} pixels")
    return Frame(
        id=value["id"],
        camera=value["camera"],
        image=np.zeros((height, width, 3), np.uint8),
        depth=None,
        matrix=read_array(value["matrix"]),
        X_WC=read_pose(value["X_WC"]),
        stamp=value["stamp"],
        visible=_unpack(value["visible"], (height, width)),
        epoch=value["epoch"],
    )


def write_detection(detection: Detection) -> list[Any]:
    """Return label, confidence, box and confidence of the second class of a detection."""
    box = [float(edge) for edge in detection.box]
    return [detection.label, float(detection.confidence), box, float(detection.rival)]


def read_detection(value: Any) -> Detection:
    """Return the detection of `write_detection`."""
    label, confidence, box, rival = value
    return Detection(label, confidence, tuple(box), rival)


def write_answer(answer: Answer) -> dict[str, Any]:
    """Return the answer of a detector as a mapping."""
    return {
        "detector": answer.detector,
        "found": list(map(write_detection, answer.found)),
        "reliability": list(astuple(answer.error_rates)),
        "doubtful": list(map(write_detection, answer.doubtful)),
        "unknown": list(map(write_detection, answer.unknown)),
    }


def read_answer(value: Any) -> Answer:
    """Return the answer of `write_answer`."""
    found, doubtful, unknown = (
        tuple(map(read_detection, value[key])) for key in ("found", "doubtful", "unknown")
    )
    return Answer(value["detector"], found, ErrorRates(*value["reliability"]), doubtful, unknown)


def write_observations(observations: Sequence[Observation]) -> list[Any]:
    """Return the observations of one frame as lists."""
    return [
        [write_detection(new.detection), new.position.tolist(), new.std, new.confident, new.contradiction]
        for new in observations
    ]


def read_observations(value: Any) -> list[Observation]:
    """Return the observations of `write_observations`."""
    return [
        Observation(read_detection(detection), read_array(position), *others)
        for detection, position, *others in value
    ]


def _pack(mask: NDArray[np.bool_]) -> str:
    """Return a mask as text; "" for a mask without False."""
    if mask.all():
        return ""
    return base64.b64encode(zlib.compress(np.packbits(mask).tobytes())).decode("ascii")


def _unpack(text: str, size: tuple[int, int]) -> NDArray[np.bool_]:
    if not text:
        return np.ones(size, np.bool_)
    bits = np.frombuffer(zlib.decompress(base64.b64decode(text)), np.uint8)
    return np.unpackbits(bits, count=size[0] * size[1]).reshape(size).astype(np.bool_)


def _identity(value: Any) -> Any:
    return value


PLAIN = Codec(_identity, _identity)
NOTHING = Codec(lambda _: None, lambda _: None)
TEXTS = Codec(list, _identity)
BOX = Codec(list, tuple)
ARRAY = Codec(np.ndarray.tolist, read_array)
POSE = Codec(write_pose, read_pose)
FRAME = Codec(write_frame, read_frame)
ANSWER = Codec(write_answer, read_answer)
OBSERVATIONS = Codec(write_observations, read_observations)
MOTION = Codec(attrgetter("duration"), RecordedMotion)
