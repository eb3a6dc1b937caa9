"""Values are the same if no part of them differs."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.geometry import Pose
from executive.messages import Target
from executive.testing.conformance.same import same

SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | st.text()
VALUES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner) | st.dictionaries(st.text(), inner) | st.tuples(inner, inner) | st.sets(st.integers())
    ),
    max_leaves=10,
)


class Node:
    """Something that knows itself, and has no equality of its own."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.me = self


def target(x: float) -> Target:
    return Target("cube-1", "cube", np.array([x, 0.0, math.nan]), 0.9, 1, 0, 0.0)


@given(VALUES)
def test_a_copy_is_the_same(value: Any) -> None:
    assert same(value, copy.deepcopy(value))


@given(VALUES, VALUES)
def test_who_is_the_same_looks_the_same(one: Any, other: Any) -> None:
    if same(one, other):
        assert repr(one) == repr(other) or one == other


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (1, 1.0),
        (True, 1),
        ([1, 2], [1, 2, 3]),
        ([1, 2], (1, 2)),
        ({"a": 1, "b": 2}, {"b": 2, "a": 1}),
        ({"a": 1}, {"a": 2}),
        (np.zeros(3), np.zeros(4)),
        (np.zeros(3), np.array([0.0, 0.0, 1e-12])),
        (np.zeros(3), np.zeros(3, dtype=int)),
        (target(0.5), target(0.6)),
        ([target(0.5)], [target(0.6)]),
        (Pose.of((0.0, 0.0, 0.0)), Pose.of((0.0, 0.0, 0.1))),
        (Node("a"), Node("b")),
    ],
)
def test_what_differs_in_any_part_is_not_the_same(one: Any, other: Any) -> None:
    assert not same(one, other)


@pytest.mark.parametrize("value", [target(0.5), Pose.of((0.0, 0.0, 0.1)), Node("a"), np.array([math.nan])])
def test_what_has_no_equality_of_its_own_is_compared_by_its_parts(value: Any) -> None:
    assert same(value, copy.deepcopy(value))
