"""`executive schema`: one JSON Schema on standard output."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner

from executive.cli.main import main
from executive.mission.schema.files import library_schema, mission_schema
from executive.mission.schema.types import cell_schema
from executive.plugins import discover
from executive.tree.registry import load_control_nodes


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ([], mission_schema(discover(), load_control_nodes())),
        (["--library"], library_schema(discover(), load_control_nodes())),
        (["--cell"], cell_schema()),
    ],
)
def test_the_schema_asked_for_is_printed(options: list[str], expected: object) -> None:
    result = CliRunner().invoke(main, ["schema", *options])
    assert result.exit_code == 0
    assert json.loads(result.stdout) == expected
