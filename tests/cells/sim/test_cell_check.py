"""Findings of a simulated cell about its cell file, and the labels of its detectors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from executive.cell.config import ArmConfig, CellConfig
from executive.cells.fake.cell import FakeCell
from executive.cells.sim.cell import SimCell
from executive.cells.sim.kind import find_pose_errors
from executive.motion.arms import build_kinematics, find_places_out_of_reach
from tests.cells.sim.conftest import shipped_cell
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


@pytest.mark.parametrize("name", ["overhead", "wrist", "depth"])
def test_nothing_is_wrong_with_a_shipped_cell(missions: Path, name: str) -> None:
    assert list(SimCell.check(shipped_cell(name), missions / "cells")) == []


def test_all_that_is_wrong_is_said_at_once(overhead: CellConfig, tmp_path: Path) -> None:
    yolo = overhead.detectors["embedded"].model_copy(update={"kind": "yolo"})
    config = posed(overhead, down=(0, 118, 0, 0, 0, 0, 0), turned=(0, 0, 0, 0, 0, 0, 180))
    far = moved(config, "red_bin", 1.5, 0.0, 0.0).bins["red_bin"]
    changes = {"bins": {"red_bin": far}, "detectors": {"yolo": yolo}, "localization": "depth"}
    found = dict(SimCell.check(config.model_copy(update=changes), tmp_path))
    assert list(found) == [
        ("localization",),
        ("detectors", "yolo", "kind"),
        ("arm", "poses_deg", "turned"),
        ("bins", "red_bin", "position"),
        ("arm", "poses_deg", "down"),
    ]
    said = found["localization",]
    assert said.startswith('localization "depth" needs a camera with depth, and overhead has none; give')


def test_the_labels_are_those_of_its_detectors(overhead: CellConfig, tmp_path: Path) -> None:
    own = {"model_path": "own.onnx", "labels": ["red", "blue"], "class_map": {"red": "cube"}}
    detectors = {
        **overhead.detectors,
        "own": overhead.detectors["embedded"].model_validate({"kind": "rfdetr", **own}),
        "yolo": overhead.detectors["embedded"].model_copy(update={"kind": "yolo"}),
    }
    labels = SimCell.labels(overhead.model_copy(update={"detectors": detectors}), tmp_path)
    assert set(labels["embedded"] or ()) == {"cube", "sphere", "duck"}
    assert labels["own"] == ("cube", "blue")
    assert labels["yolo"] is None


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


@pytest.mark.parametrize("kind", [SimCell, FakeCell])
def test_an_arm_without_kinematics_is_a_finding_with_the_supported_arms(overhead: CellConfig, kind) -> None:
    config = overhead.model_copy(update={"arm": overhead.arm.model_copy(update={"urdf": "r2d2.urdf"})})
    ((keys, message),) = kind.check(config, Path())
    assert keys == ("arm", "urdf")
    assert message.endswith("supported: kuka_iiwa/model.urdf")


def test_limits_of_another_number_of_joints_are_a_finding(overhead: CellConfig) -> None:
    limits = {name: value[:6] if isinstance(value, tuple) else value for name, value in overhead.arm.limits}
    arm = ArmConfig(limits=limits, poses_deg={"home": overhead.arm.poses_deg["home"][:6]})
    ((keys, message),) = SimCell.check(overhead.model_copy(update={"arm": arm}), Path())
    assert keys == ("arm", "limits")
    assert "has 7 joints, but the limits of 6 joints" in message


@pytest.mark.parametrize(
    ("position", "why"),
    [
        ((0.6, -0.6, 0.0), "beyond the reach of the arm (0.82 m)"),
        ((0.24, -0.25, 0.0), "nearer than joint 4 permits (0.41 m)"),
    ],
)
def test_a_bin_with_one_slot_out_of_reach_is_named_with_the_distance(
    overhead: CellConfig, position: tuple[float, float, float], why: str
) -> None:
    ((keys, sentence),) = find_places_out_of_reach(moved(overhead, "red_bin", *position))
    assert keys == ("bins", "red_bin", "position")
    assert sentence.startswith('the bin "red_bin" is out of reach: the tool cannot reach (')
    assert sentence.endswith(why)
