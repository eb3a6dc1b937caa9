"""Arguments of constructors: where they are declared, and their values in missions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import pytest
from foreign import Colour, Double, Painter, Primer, Untyped
from py_trees.common import Status

from executive.behaviours import find_mission_type, list_arguments, to_argument

Statuses = Literal["SUCCESS", "FAILURE", "RUNNING", "INVALID"]


def test_arguments_have_types_defaults_and_descriptions() -> None:
    arguments = list_arguments(Painter)
    assert list(arguments) == ["name", "colour", "then", "stroke"]
    assert (arguments["colour"].type, arguments["colour"].default) == (Colour, ...)
    assert arguments["colour"].doc == "colour of the paint, which dries"
    assert (arguments["stroke"].type, arguments["stroke"].default) == (float, 0.1)
    assert {name: argument.type for name, argument in list_arguments(Untyped).items()} == {
        "thing": Any,
        "other": Any,
    }


def test_arguments_that_a_constructor_passes_on_are_found() -> None:
    assert list(list_arguments(Primer)) == ["coats", "name", "colour", "then", "stroke"]
    assert list(list_arguments(Double)) == ["name"]


@pytest.mark.parametrize(
    ("hint", "expected"),
    [
        (int, int),
        (Colour, Literal["RED", "BLUE"]),
        (Sequence[Status], list[Statuses]),
        (Mapping[str, int], dict[str, int]),
        (tuple[float, ...], tuple[float, ...]),
        (str | Path, str),
        (Callable[[], int], None),
    ],
)
def test_a_mission_names_members_and_contains_plain_values(hint: object, expected: object) -> None:
    assert find_mission_type(hint) == expected


@pytest.mark.parametrize(
    ("value", "hint", "expected"),
    [
        ("FAILURE", str | Status, Status.FAILURE),
        (["SUCCESS", "RUNNING"], list[Status], [Status.SUCCESS, Status.RUNNING]),
        (["BLUE", "FAILURE"], tuple[Colour, Status], [Colour.BLUE, Status.FAILURE]),
        ({"RED": ["BLUE"]}, Mapping[Colour, Sequence[Colour]], {Colour.RED: [Colour.BLUE]}),
        ([1, 2, 3], tuple[int, int] | list[int], [1, 2, 3]),
        ({"a": 1}, list[int] | dict[str, int], {"a": 1}),
    ],
)
def test_names_become_members(value: object, hint: object, expected: object) -> None:
    assert to_argument(value, hint) == expected
