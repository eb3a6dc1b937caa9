"""Poses of a cell file that cannot serve are found before anything moves."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from executive.cell_config import CellConfig
from executive.geometry import tool_down
from executive.mission.parse.cell_file import load_cell
from executive.motion.kinematics import Kinematics
from executive.sim.poses import unfit_poses


@pytest.fixture
def overhead(missions: Path) -> CellConfig:
    return load_cell(missions / "cells" / "overhead.yaml")


def with_poses(config: CellConfig, **poses: Sequence[float]) -> CellConfig:
    """Return the cell with other poses beside its own, or instead of them."""
    return config.model_copy(
        update={"arm": config.arm.model_copy(update={"poses_deg": {**config.arm.poses_deg, **poses}})}
    )


def reaching(config: CellConfig, place: tuple[float, float, float]) -> Sequence[float]:
    """Return the pose [degree] with the tool straight down at a place [m]."""
    kinematics = Kinematics(config.tool.length, np.radians(config.arm.limits.position_deg))
    home = np.radians(config.arm.poses_deg["home"])
    return tuple(np.degrees(kinematics.nearest_solution(tool_down(place), home)))


def test_a_pose_too_near_to_the_table_is_named_with_the_distance(overhead: CellConfig) -> None:
    near, inside = (reaching(overhead, (0.5, 0.0, z)) for z in (0.003, -0.01))
    assert list(unfit_poses(with_poses(overhead, near=near, inside=inside))) == [
        (
            ("arm", "poses_deg", "near"),
            'the pose "near" brings the tool 0.003 m from the table; 0.005 m must stay free',
        ),
        (
            ("arm", "poses_deg", "inside"),
            'the pose "inside" brings the tool 0.010 m into the table; 0.005 m must stay free',
        ),
    ]


def test_home_too_near_to_a_bin_is_found(overhead: CellConfig) -> None:
    bin = overhead.bins["red_bin"]
    home = reaching(overhead, (bin.position[0], bin.position[1] + bin.size[1] / 2, 0.05))
    ((keys, sentence),) = unfit_poses(with_poses(overhead, home=home))
    assert keys == ("arm", "poses_deg", "home")
    assert re.fullmatch(
        r'the pose "home" brings the tool 0\.0\d\d m into red_bin; .* must stay free', sentence
    )


def test_a_pose_that_folds_the_arm_onto_itself_is_found(overhead: CellConfig) -> None:
    ((keys, sentence),) = unfit_poses(with_poses(overhead, folded=(0, -40, 0, -120, 0, -120, 0)))
    assert keys == ("arm", "poses_deg", "folded")
    assert re.match(r'the pose "folded" brings link 5 0\.0\d\d m into link 7;', sentence)


def test_a_pose_as_near_as_the_margin_allows_is_fit(overhead: CellConfig) -> None:
    assert list(unfit_poses(with_poses(overhead, near=reaching(overhead, (0.5, 0.0, 0.0055))))) == []


def test_a_scan_pose_in_front_of_a_fixed_camera_is_found(overhead: CellConfig) -> None:
    config = with_poses(overhead, aside=reaching(overhead, (0.53, 0.0, 0.2)))
    assert list(unfit_poses(config)) == [
        (
            ("cameras", "overhead", "scan_poses", 1),
            'from the pose "aside" the camera overhead does not see the whole workspace: a part of it is '
            "outside of the image or behind the arm",
        )
    ]


def test_a_scan_pose_from_which_the_wrist_looks_past_the_workspace_is_found(missions: Path) -> None:
    wrist = load_cell(missions / "cells" / "wrist.yaml")
    turned = (40.0, *wrist.arm.poses_deg["scan"][1:])
    found = list(unfit_poses(with_poses(wrist, scan=turned)))
    assert [keys for keys, _ in found] == [("cameras", "wrist", "scan_poses", 0)]


def test_a_model_that_is_no_iiwa_is_a_finding_and_no_traceback(overhead: CellConfig) -> None:
    config = overhead.model_copy(update={"arm": overhead.arm.model_copy(update={"urdf": "r2d2.urdf"})})
    assert list(unfit_poses(config)) == [
        (("arm", "urdf"), "the model r2d2.urdf cannot be loaded as an iiwa 14: Cannot load URDF file.")
    ]
