"""Findings of the station about a cell file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from executive.cell.config import CellConfig
from executive.mission.cell_file import load_cell, read_cell
from executive.motion.joints import build_kinematics
from executive.station.check import CellChecker, find_pose_errors, find_view_errors, load_checker
from executive.text.files import get_shipped_folder
from tests.motion.joint_states import reach

CELLS = get_shipped_folder() / "cells"
TRANSFORM = "{rotation: [2.2214, -2.2214, 0], translation: [0, 0.5, 1.2]}"
INVERSE = f"{{matrix: [461, 0, 319.5, 0, 461, 239.5, 0, 0, 1], camera_to_mount: {TRANSFORM}}}"
"""A calibration that is wrong because its key should be `mount_to_camera`."""


def posed(config: CellConfig, **poses: Any) -> CellConfig:
    """Return the cell with other named poses [degree] beside its own, or instead of them."""
    arm = config.arm.model_copy(update={"poses_deg": {**config.arm.poses_deg, **poses}})
    return config.model_copy(update={"arm": arm})


def moved(config: CellConfig, bin: str, *position: float) -> CellConfig:
    """Return the cell with a bin elsewhere [m]."""
    section = config.bins[bin].model_copy(update={"position": position})
    return config.model_copy(update={"bins": {**config.bins, bin: section}})


def reaching(config: CellConfig, *place: float) -> Sequence[float]:
    """Return the pose [degree] with the tool straight down at a place [m]."""
    kinematics = build_kinematics(config)
    home = np.radians(config.arm.poses_deg["home"])
    return tuple(np.degrees(reach(kinematics, place, home)))


def test_all_that_is_wrong_is_said_at_once(overhead: CellConfig, tmp_path: Path) -> None:
    yolo = overhead.detectors["embedded"].model_copy(update={"kind": "yolo"})
    config = posed(overhead, down=(0, 118, 0, 0, 0, 0, 0), turned=(0, 0, 0, 0, 0, 0, 180))
    far = moved(config, "red_bin", 1.5, 0.0, 0.0).bins["red_bin"]
    changes = {"bins": {"red_bin": far}, "detectors": {"yolo": yolo}, "localization": "depth"}
    found = dict(load_checker("sim").check(config.model_copy(update=changes), tmp_path))
    assert list(found) == [
        ("localization",),
        ("arm", "poses_deg", "turned"),
        ("bins", "red_bin", "position"),
        ("detectors", "yolo", "kind"),
        ("arm", "poses_deg", "down"),
    ]
    said = found["localization",]
    assert said.startswith('localization "depth" needs a camera with depth, and overhead has none; give')


def test_a_pose_too_near_to_something_is_named_with_the_distance(overhead: CellConfig) -> None:
    near, inside, fit = (reaching(overhead, 0.5, 0.0, z) for z in (0.003, -0.01, 0.0055))
    folded = (0, -40, 0, -120, 0, -120, 0)
    found = dict(find_pose_errors(posed(overhead, near=near, inside=inside, fit=fit, folded=folded)))
    free = "the minimum clearance is 0.005 m"
    assert found == {
        ("arm", "poses_deg", "near"): f'the pose "near" brings the tool 0.003 m from the table; {free}',
        ("arm", "poses_deg", "inside"): f'the pose "inside" brings the tool 0.010 m into the table; {free}',
        ("arm", "poses_deg", "folded"): f'the pose "folded" brings link 5 0.013 m into link 7; {free}',
    }


def test_a_scan_pose_without_a_view_of_it_all_is_found(overhead: CellConfig, wrist: CellConfig) -> None:
    assert list(find_pose_errors(posed(overhead, aside=reaching(overhead, 0.53, 0.0, 0.2)))) == [
        (
            ("cameras", "overhead", "scan_poses", 1),
            'in the pose "aside" the arm hides a part of the workspace from the camera overhead',
        )
    ]
    turned = (80.0, *wrist.arm.poses_deg["scan"][1:])
    assert [key for key, _ in find_pose_errors(posed(wrist, scan=turned))] == [
        ("cameras", "wrist", "scan_poses", 0)
    ]


@pytest.mark.parametrize("kind", ["sim", "fake"])
def test_an_unknown_solver_is_a_finding_with_the_installed_solvers(overhead: CellConfig, kind: str) -> None:
    config = overhead.model_copy(update={"arm": overhead.arm.model_copy(update={"solver": "r2d2"})})
    ((keys, message),) = load_checker(kind).check(config, Path())
    assert keys == ("arm", "solver")
    assert message.endswith("Installed solvers: auto, eaik, iiwa14, numeric.")


def test_a_wrong_model_of_the_arm_is_a_finding_with_every_driver(overhead: CellConfig) -> None:
    kind: Any = SimpleNamespace(check=lambda config, cell_folder: ())
    arm = overhead.arm.model_copy(update={"urdf": "cobot.urdf"})
    ((keys, message),) = CellChecker(kind).check(overhead.model_copy(update={"arm": arm}), Path())
    assert (keys, message.partition(",")[0]) == (("arm", "urdf"), "there is no model cobot.urdf")


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
        ("wrist", {"scan_poses": "[scan, left_half]"}, ["scan_poses", 1], 'from the pose "left_half"'),
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


@pytest.mark.parametrize("kind", ["sim", "fake"])
def test_the_views_of_every_kind_of_cell_are_checked(kind: str) -> None:
    config = changed("overhead", table_view=[0, 0, 64, 64])
    assert [key for key, _ in load_checker(kind).check(config, CELLS)] == [
        ("cameras", "overhead", "table_view")
    ]
