"""Findings of a simulated cell about its cell file, and the labels of its detectors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from executive.drivers.sim.kind import SIM_CELL_KIND

from executive.cell.config import CellConfig
from executive.motion.joints import build_kinematics
from executive.station.pose_check import find_pose_errors
from executive.testing.fake_cell import FakeCell
from tests.motion.joint_states import reach


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
    found = dict(SIM_CELL_KIND.check(config.model_copy(update=changes), tmp_path))
    assert list(found) == [
        ("localization",),
        ("detectors", "yolo", "kind"),
        ("arm", "poses_deg", "turned"),
        ("bins", "red_bin", "position"),
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
    turned = (40.0, *wrist.arm.poses_deg["scan"][1:])
    assert [key for key, _ in find_pose_errors(posed(wrist, scan=turned))] == [
        ("cameras", "wrist", "scan_poses", 0)
    ]


@pytest.mark.parametrize("kind", [SIM_CELL_KIND, FakeCell])
def test_an_unknown_solver_is_a_finding_with_the_installed_solvers(overhead: CellConfig, kind) -> None:
    config = overhead.model_copy(update={"arm": overhead.arm.model_copy(update={"solver": "r2d2"})})
    ((keys, message),) = kind.check(config, Path())
    assert keys == ("arm", "solver")
    assert message.endswith("Installed solvers: iiwa14.")
