"""Values as records keep them."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum, IntEnum
from functools import reduce
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pytest

from executive.cell.frame import Detection, Frame
from executive.cell.json_values import MAX_INTEGER_BITS, to_json, to_json_or_type_name
from executive.geometry import Pose


class Corner(NamedTuple):
    x: float
    y: float


Colour = Enum("Colour", {"RED": "red"})
Level = IntEnum("Level", {"HIGH": 3})


FRAME = Frame(
    7, "overhead", np.zeros((4, 4, 3), np.uint8), None, np.eye(3), Pose.identity(), 1 / 3,
    np.ones((4, 4), bool), 0,
)  # fmt: skip

DUCK = {"label": "duck", "confidence": 0.6, "box": [1, 2.5, 3.0, 4], "second_confidence": 0.0}


@pytest.mark.parametrize(
    ("value", "kept"),
    [
        (np.float64(2 / 3), 0.666667), (np.longdouble(1) / 3, 0.333333), (-0.0, 0.0),
        (float("nan"), "nan"), (float("-inf"), "-inf"), (np.int64(4), 4), (np.bool_(True), True),
        (np.array([[1.0, 2.00000049]]), [[1.0, 2.0]]), (np.array(["a"]), ["a"]),
        ({1: (1, 2)}, {"1": [1, 2]}), (MappingProxyType({"a": np.uint8(3)}), {"a": 3}),
        ({"b", "a"}, ["a", "b"]), (frozenset({2.5, 1.5}), [1.5, 2.5]),
        (Colour.RED, "red"), (Level.HIGH, 3),
        (Corner(1 / 3, -0.0), [0.333333, 0.0]),
        (b"bytes", "bytes"), (int, "type"), (object(), "object"), (Path("a/b"), "a/b"),
        (FRAME, {"frame": 7, "camera": "overhead", "stamp": 0.333333}),
        (Detection("duck", 0.6, (1, 2.5, np.float64(3), 4)), DUCK),
        pytest.param(2**MAX_INTEGER_BITS - 1, 2**MAX_INTEGER_BITS - 1, id="largest"),
        pytest.param(-(2**MAX_INTEGER_BITS), "-0x1" + "0" * (MAX_INTEGER_BITS // 4), id="too large"),
        ("caf\udce9 ü", "caf\\udce9 ü"), ({"\ud800": 1}, {"\\ud800": 1}), (Path("a\udcff"), "a\\udcff"),
    ],
)  # fmt: skip
def test_becomes_plain(value, kept):
    assert to_json(value) == kept
    assert repr(to_json(value)) == repr(kept)


class Shy(Mapping):
    """Raises whenever it is asked for its content."""

    def __iter__(self):
        raise RuntimeError

    __len__ = __getitem__ = __iter__


ENDLESS: list = [1]
ENDLESS.append(ENDLESS)
DEEP = reduce(lambda inner, number: [inner] if number % 2 else {"a": inner}, range(5000), 1)


@pytest.mark.parametrize(
    ("value", "kept"), [(Shy(), "Shy"), (ENDLESS, "list"), (DEEP, "list"), (1 / 3, 0.333333)]
)
def test_a_value_without_a_plain_form_is_named_by_its_type(value, kept):
    assert to_json_or_type_name(value) == kept
