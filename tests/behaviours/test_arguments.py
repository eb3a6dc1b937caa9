"""Arguments of constructors: where they are declared, and their values in missions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import pytest
from foreign import Colour, Double, Painter, Primer, Untyped
from py_trees.behaviours import StatusQueue, Success
from py_trees.common import Status

from executive.behaviours.arguments import find_mission_type, list_arguments, to_argument

Statuses = Literal["SUCCESS", "FAILURE", "RUNNING", "INVALID"]


def test_arguments_have_types_defaults_and_descriptions() -> None:
    arguments = list_arguments(Painter)
    assert list(arguments) == ["name", "colour", "then", "stroke"]
    assert (arguments["colour"].type, arguments["colour"].default) == (Colour, ...)
    assert (arguments["stroke"].type, arguments["stroke"].default) == (float, 0.1)
    assert arguments["colour"].doc == "colour of the paint, which dries"
    assert arguments["then"].doc == "statuses, in order"


def test_arguments_that_a_constructor_passes_on_are_found() -> None:
    assert list(list_arguments(Primer)) == ["coats", "name", "colour", "then", "stroke"]
    assert list(list_arguments(Double)) == ["name"]
    assert list(list_arguments(Success)) == ["name"]


def test_types_that_cannot_be_resolved_accept_everything() -> None:
    arguments = list_arguments(Untyped)
    assert {name: argument.type for name, argument in arguments.items()} == {"thing": Any, "other": Any}


@pytest.mark.parametrize(
    ("hint", "expected"),
    [
        (int, int),
        (Any, Any),
        (Colour, Literal["RED", "BLUE"]),
        (list[Status], list[Statuses]),
        (Sequence[float], list[float]),
        (Mapping[str, int], dict[str, int]),
        (tuple[float, ...], tuple[float, ...]),
        (Status | None, Statuses | None),
        (Any | Callable[[], Any], Any),
        (str | Path, str),
        (Literal["a", "b"], Literal["a", "b"]),
        (Path, None),
        (list[Path], None),
        (Callable[[], int], None),
    ],
)
def test_a_mission_names_members_and_contains_plain_values(hint: object, expected: object) -> None:
    assert find_mission_type(hint) == expected


@pytest.mark.parametrize(
    ("value", "hint", "expected"),
    [
        ("BLUE", Colour, Colour.BLUE),
        (["SUCCESS", "RUNNING"], list[Status], [Status.SUCCESS, Status.RUNNING]),
        ("FAILURE", Status | None, Status.FAILURE),
        (None, Status | None, None),
        ("a", str | Status, "a"),
        ([1, 2], list[int], [1, 2]),
        (["BLUE", "FAILURE"], tuple[Colour, Status], [Colour.BLUE, Status.FAILURE]),
        (["BLUE", "RED"], tuple[Colour, ...], [Colour.BLUE, Colour.RED]),
        ({"edge": "RED"}, dict[str, Colour], {"edge": Colour.RED}),
        ({"edge": ["RED"]}, Mapping[str, Sequence[Colour]], {"edge": [Colour.RED]}),
        (3, Any, 3),
        ([1, 2, 3], tuple[int, int] | list[int], [1, 2, 3]),
        ({"a": 1}, list[int] | dict[str, int], {"a": 1}),
        ({"RED": 1}, dict[Colour, int], {Colour.RED: 1}),
    ],
)
def test_names_become_members(value: object, hint: object, expected: object) -> None:
    assert to_argument(value, hint) == expected


def test_the_status_queue_gets_statuses() -> None:
    arguments = list_arguments(StatusQueue)
    assert to_argument(["RUNNING"], arguments["queue"].type) == [Status.RUNNING]
    assert to_argument("SUCCESS", arguments["eventually"].type) is Status.SUCCESS
