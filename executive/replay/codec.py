"""Codecs between the answers of a cell and plain values; nothing is lost but images and paths."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from executive.cell.arm import Motion
from executive.cell.detection import Answer, Detection, Observation
from executive.cell.error_rates import ErrorRates
from executive.cell.frame import Frame
from executive.geometry import Array, Pose

MAX_PIXELS = 10**8
"""Largest number of pixels of an image."""


class Codec(NamedTuple):
    """Functions between an answer of a cell and its plain form.

    Attributes:
        write: Returns an answer as plain values.
        read: Returns an answer from plain values.
    """

    write: Callable[[Any], Any]
    read: Callable[[Any], Any]


@dataclass(frozen=True)
class RecordedMotion:
    """Duration of a planned motion [s], the recorded part of the motion; implements `cell.arm.Motion`."""

    duration: float


def read_array(value: Any) -> Array:
    """Return an array from lists of floats."""
    return np.array(value, dtype=np.float64)


def write_pose(pose: Pose) -> list[Any]:
    """Return rotation and position of a pose."""
    return [pose.rotation.tolist(), pose.position.tolist()]


def read_pose(value: Any) -> Pose:
    """Return what `write_pose` was given."""
    rotation, position = value
    return Pose(read_array(rotation), read_array(position))


def write_frame(frame: Frame) -> dict[str, Any]:
    """Return a frame without what it shows: image and depth are not kept."""
    return {
        "id": frame.id,
        "camera": frame.camera,
        "matrix": frame.matrix.tolist(),
        "X_WC": write_pose(frame.X_WC),
        "stamp": frame.stamp,
        "epoch": frame.epoch,
        "visible": _packed(frame.visible),
        "size": list(frame.visible.shape),
    }


def read_frame(value: Any) -> Frame:
    """Return what `write_frame` was given, its image black and without depth."""
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
        visible=_unpacked(value["visible"], (height, width)),
        epoch=value["epoch"],
    )


def write_detection(detection: Detection) -> list[Any]:
    """Return label, confidence, box and confidence of the second class."""
    box = [float(edge) for edge in detection.box]
    return [detection.label, float(detection.confidence), box, float(detection.rival)]


def read_detection(value: Any) -> Detection:
    """Return what `write_detection` was given."""
    label, confidence, box, rival = value
    return Detection(label, confidence, tuple(box), rival)


def write_answer(answer: Answer) -> dict[str, Any]:
    """Return a detector's answer."""
    return {
        "detector": answer.detector,
        "found": [write_detection(one) for one in answer.found],
        "reliability": list(astuple(answer.error_rates)),
        "doubtful": [write_detection(one) for one in answer.doubtful],
        "unknown": [write_detection(one) for one in answer.unknown],
    }


def read_answer(value: Any) -> Answer:
    """Return what `write_answer` was given."""
    found, doubtful, unknown = (
        tuple(read_detection(one) for one in value[key]) for key in ("found", "doubtful", "unknown")
    )
    return Answer(value["detector"], found, ErrorRates(*value["reliability"]), doubtful, unknown)


def write_observations(observations: Sequence[Observation]) -> list[Any]:
    """Return the observations of one frame."""
    return [
        [write_detection(one.detection), one.position.tolist(), one.std, one.confident, one.contradiction]
        for one in observations
    ]


def read_observations(value: Any) -> list[Observation]:
    """Return what `write_observations` was given."""
    return [
        Observation(read_detection(detection), read_array(position), *others)
        for detection, position, *others in value
    ]


def _packed(mask: NDArray[np.bool_]) -> str:
    """Return a mask as text; "" where all of it is true."""
    if mask.all():
        return ""
    return base64.b64encode(zlib.compress(np.packbits(mask).tobytes())).decode("ascii")


def _unpacked(text: str, size: tuple[int, int]) -> NDArray[np.bool_]:
    if not text:
        return np.ones(size, np.bool_)
    bits = np.frombuffer(zlib.decompress(base64.b64decode(text)), np.uint8)
    return np.unpackbits(bits, count=size[0] * size[1]).reshape(size).astype(np.bool_)


def _identity(value: Any) -> Any:
    return value


def _duration(motion: Motion) -> float:
    return motion.duration


def _nothing(value: Any) -> None:
    del value


PLAIN = Codec(_identity, _identity)
NOTHING = Codec(_nothing, _nothing)
TEXTS = Codec(list, _identity)
BOX = Codec(list, tuple)
ARRAY = Codec(np.ndarray.tolist, read_array)
POSE = Codec(write_pose, read_pose)
FRAME = Codec(write_frame, read_frame)
ANSWER = Codec(write_answer, read_answer)
OBSERVATIONS = Codec(write_observations, read_observations)
MOTION = Codec(_duration, RecordedMotion)
