"""`executive schema`: one JSON Schema on standard output."""

from __future__ import annotations

import json
from collections.abc import Callable

import pytest
from at_terminal import invoke

from executive.behaviours import load_skills
from executive.mission.schema import (
    make_arm_schema,
    make_cell_schema,
    make_library_schema,
    make_mission_schema,
)
from executive.tree.node import load_control_nodes


@pytest.mark.parametrize(
    ("options", "make"),
    [
        ([], lambda: make_mission_schema(load_skills(), load_control_nodes())),
        (["--library"], lambda: make_library_schema(load_skills(), load_control_nodes())),
        (["--cell"], make_cell_schema),
        (["--arm"], make_arm_schema),
    ],
)
def test_the_schema_asked_for_is_printed(options: list[str], make: Callable[[], object]) -> None:
    result = invoke("schema", *options)
    assert result.exit_code == 0
    assert json.loads(result.stdout) == make()
