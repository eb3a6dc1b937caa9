"""Values as records keep them."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum
from pathlib import Path, PurePath
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.events import Exact
from executive.geometry import Pose
from executive.messages import Detection, Detections, Frame, Reliability, Target
from executive.record.plain import DIGITS, LONGEST, plain


class Colour(Enum):
    RED = "red"


class Shade(str, Enum):
    DARK = "dark"


class Level(IntEnum):
    HIGH = 3


class Share(float, Enum):
    THIRD = 1 / 3


class Corner(NamedTuple):
    x: float
    y: float


@dataclass
class Pair:
    left: float
    right: tuple[int, ...]


EYE = Reliability(threshold=0.5, misses=0.02, confused=0.0025, invented=0.02, jitter=0.6)
FRAME = Frame(
    7, "overhead", np.zeros((4, 4, 3), np.uint8), None, np.eye(3), Pose.identity(), 1 / 3,
    np.ones((4, 4), bool), 0,
)  # fmt: skip


@pytest.mark.parametrize(
    ("value", "kept"),
    [
        (1 / 3, 0.333333),
        (np.float64(2 / 3), 0.666667),
        (np.int64(4), 4),
        (np.bool_(True), True),
        (-0.0, 0.0),
        (np.array([[1.0, 2.00000049]]), [[1.0, 2.0]]),
        ({1: (1, 2)}, {"1": [1, 2]}),
        ({"b", "a"}, ["a", "b"]),
        (Colour.RED, "red"),
        (Path("a/b"), "a/b"),
        (Pair(0.1, (1,)), {"left": 0.1, "right": [1]}),
        (float("nan"), "nan"),
        (float("-inf"), "-inf"),
        (object(), "object"),
        pytest.param(2**LONGEST - 1, 2**LONGEST - 1, id="largest"),
        pytest.param(-(2**LONGEST), "-0x1" + "0" * (LONGEST // 4), id="too large"),
        ("größe", "größe"),
        ("caf\udce9 ü", "caf\\udce9 ü"),
        ({"\ud800": 1}, {"\\ud800": 1}),
        (Path("a\udcff"), "a\\udcff"),
        (np.str_("\udfff"), "\\udfff"),
        ([Exact([1 / 3, "\udfff"]), 1 / 3], [[1 / 3, "\udfff"], 0.333333]),
    ],
)
def test_becomes_plain(value, kept):
    assert plain(value) == kept
    assert repr(plain(value)) == repr(kept)


def test_a_frame_is_kept_by_its_number_and_not_its_pixels():
    assert plain({"frame": FRAME}) == {"frame": {"frame": 7, "camera": "overhead", "stamp": 0.333333}}


def straightforward(value: Any) -> Any:
    """Say the same as `plain`, every question asked for every value."""
    if value is None or isinstance(value, (str, bool, int)):
        return value.value if isinstance(value, Enum) else value
    if isinstance(value, (float, np.floating)):
        return round(float(value), DIGITS) + 0.0 if math.isfinite(value) else str(float(value))
    if isinstance(value, np.generic):
        return straightforward(value.item())
    if isinstance(value, np.ndarray):
        return straightforward(value.tolist())
    if isinstance(value, Frame):
        return {"frame": value.id, "camera": value.camera, "stamp": straightforward(value.stamp)}
    if isinstance(value, Pose):
        return value.rounded(DIGITS)
    if isinstance(value, Mapping):
        return {str(key): straightforward(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [straightforward(entry) for entry in value]
    if isinstance(value, (set, frozenset)):
        return sorted((straightforward(entry) for entry in value), key=repr)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: straightforward(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Enum):
        return straightforward(value.value)
    return str(value) if isinstance(value, PurePath) else type(value).__name__


ODD = [
    *Colour, *Shade, *Level, *Share, Corner(1 / 3, -0.0), Path("a/b"), Pose.identity(), FRAME, object(),
    Colour, int, b"bytes", 1j, np.bool_(False), np.array([[True]]), np.array(["a"]), np.longdouble(1) / 3,
    Detections(FRAME, (Detection("duck", 0.6, (1, 2.5, np.float64(3), 4)),), "e", EYE, "full", (0, 0, 4, 4)),
    Target("duck-1", "duck", np.array([1 / 3, np.nan, -0.0]), 0.9, 7, 0, 1e-9),
]  # fmt: skip
SCALARS = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=5)
    | st.floats().map(np.float64)
    | st.floats(width=32).map(np.float32)
    | st.integers(0, 255).map(np.uint8)
    | st.text(max_size=5).map(np.str_)
    | st.lists(st.floats(), max_size=3).map(np.array)
    | st.sampled_from(ODD)
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.lists(inner, max_size=3).map(tuple)
        | st.dictionaries(st.text(max_size=3) | st.integers(), inner, max_size=3)
        | st.dictionaries(st.text(max_size=3), inner, max_size=3).map(MappingProxyType)
        | st.builds(Pair, inner, inner)
        | st.sets(st.text(max_size=3) | st.integers(), max_size=3)
        | st.frozensets(st.floats(), max_size=3)
    ),
    max_leaves=10,
)


@pytest.mark.parametrize("value", ODD, ids=lambda value: type(value).__name__)
def test_says_of_odd_values_what_the_straightforward_way_says(value):
    assert repr(plain(value)) == repr(straightforward(value))


@settings(deadline=None)
@given(VALUES)
def test_says_what_the_straightforward_way_says(value):
    assert repr(plain(value)) == repr(straightforward(value))


@given(st.recursive(st.floats() | st.integers() | st.text(), lambda inner: st.lists(inner, max_size=3)))
def test_everything_plain_is_json(value):
    json.dumps(plain(value), allow_nan=False)


EXACT = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters()),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(st.characters()), inner, max_size=3),
    max_leaves=10,
)


@given(EXACT)
def test_what_is_exact_comes_back_from_json_bit_for_bit(value):
    assert plain(Exact(value)) is value
    # A repr tells -0.0 from 0.0 and every float from its neighbours.
    assert repr(json.loads(json.dumps(plain({"value": Exact(value)})))) == repr({"value": value})
