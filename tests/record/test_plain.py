"""Values as records keep them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.geometry import Pose
from executive.messages import Frame
from executive.record.plain import plain


class Colour(Enum):
    RED = "red"


@dataclass
class Pair:
    left: float
    right: tuple[int, ...]


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
    ],
)
def test_becomes_plain(value, kept):
    assert plain(value) == kept
    assert repr(plain(value)) == repr(kept)


def test_a_frame_is_kept_by_its_number_and_not_its_pixels():
    image = np.zeros((4, 4, 3), np.uint8)
    visible = np.ones((4, 4), bool)
    frame = Frame(7, "overhead", image, None, np.eye(3), Pose.identity(), 1.25, visible, 0)
    assert plain({"frame": frame}) == {"frame": {"frame": 7, "camera": "overhead", "stamp": 1.25}}


@given(st.recursive(st.floats() | st.integers() | st.text(), lambda inner: st.lists(inner, max_size=3)))
def test_everything_plain_is_json(value):
    json.dumps(plain(value), allow_nan=False)
