"""Checks that the views of a camera show the workspace."""

from __future__ import annotations

from typing import Any

import pytest
from executive.drivers.sim.kind import SIM_CELL_KIND

from executive.cell.config import CellConfig
from executive.cell.devices import CellKind
from executive.mission.cell_file import load_cell, read_cell
from executive.station.check import find_view_errors
from executive.testing.fake_cell import FakeCell
from executive.text.yaml_files import get_shipped_folder

CELLS = get_shipped_folder() / "cells"
TRANSFORM = "{rotation: [2.2214, -2.2214, 0], translation: [0, 0.5, 1.2]}"
INVERSE = f"{{matrix: [461, 0, 319.5, 0, 461, 239.5, 0, 0, 1], camera_to_mount: {TRANSFORM}}}"
"""A calibration that is wrong because its key should be `mount_to_camera`."""


def changed(cell: str, **values: Any) -> CellConfig:
    """Return a shipped cell with other values of its camera."""
    (name,) = load_cell(CELLS / f"{cell}.yaml").cameras
    overrides = {f"cell.cameras.{name}.{key}": str(value) for key, value in values.items()}
    config = read_cell(CELLS / f"{cell}.yaml", overrides).config
    assert config is not None
    return config


@pytest.mark.parametrize(
    ("cell", "values", "keys", "fragment"),
    [
        ("overhead", {"table_view": [250, 150, 390, 290]}, ["table_view"], "view is [231, 139, 409, 317]"),
        ("overhead", {"position": [0.5, 0, -1.2]}, ["position"], "100% of the workspace"),
        ("overhead", {"fov_deg": 170}, ["fov_deg"], "1.0 pixels"),
        ("depth", {"calibration": INVERSE}, ["calibration"], "exchange"),
        ("depth", {"calibration": INVERSE.replace("-2.2214, 0]", "-2, 0.3]")}, ["table_view"], "exchange"),
        ("wrist", {"scan_poses": "[scan, home]"}, ["scan_poses", 1], 'from the pose "home"'),
        ("wrist_halves", {"scan_poses": "[left_half]"}, ["scan_poses"], "y -0.22 to -0.02 m"),
        ("wrist_halves", {"partial_views": "false"}, ["scan_poses", 0], 'from the pose "left_half"'),
        ("wrist_halves", {"table_view": [0, 0, 64, 64]}, ["table_view"], "correct"),
    ],
)  # fmt: skip
def test_a_view_without_the_workspace_is_named_with_what_it_lacks(
    cell: str, values: dict[str, Any], keys: list[str | int], fragment: str
) -> None:
    key_path, message = next(find_view_errors(changed(cell, **values)))
    assert list(key_path[2:]) == keys
    assert fragment in message


@pytest.mark.parametrize("kind", [SIM_CELL_KIND, FakeCell])
def test_every_kind_of_cell_checks_the_views(kind: CellKind) -> None:
    config = changed("overhead", table_view=[0, 0, 64, 64])
    assert [key for key, _ in kind.check(config, CELLS)] == [("cameras", "overhead", "table_view")]
