"""The fake cell is the cell of its file, less the physics."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from executive.cell.config import CellConfig
from executive.cell.devices import DriverOptions, check_driver_options
from executive.cell.frame import Detections
from executive.drivers.fake import FakeDriver
from executive.errors import InputError
from executive.mission.cell_file import load_cell
from executive.station.check import load_checker
from executive.station.station import AUDIT_KEYS
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from executive.tools.suction import Suction
from skills.detect import Detect
from skills.localize import Localize
from skills.move_to_scan import MoveToScan

Load = Callable[..., CellConfig]


@pytest.fixture
def load(missions: Path) -> Load:
    """Load a shipped cell file with some keys changed."""

    def load(name: str = "overhead", **changes: str) -> CellConfig:
        overrides = {f"cell.{key.replace('__', '.')}": value for key, value in changes.items()}
        return load_cell(missions / "cells" / f"{name}.yaml", overrides)

    return load


def placements(fake: FakeCell) -> list[tuple[str, float, float]]:
    return [(thing.label, *thing.position[:2]) for thing in fake.world.objects]


def test_as_many_objects_as_the_file_says_lie_apart_on_its_table(load: Load) -> None:
    config = load(table__objects="[5, 7]", table__x="[0.3, 0.5]")
    counts = set()
    for seed in range(20):
        things = placements(FakeCell(config, seed=seed))
        counts.add(len(things))
        for number, (label, x, y) in enumerate(things):
            assert 0.3 <= x <= 0.5 and -0.22 <= y <= 0.22
            for neighbour, u, v in things[:number]:
                room = config.objects[label].radius + config.objects[neighbour].radius + config.table.gap
                assert np.hypot(x - u, y - v) >= room - 1e-9
        assert placements(FakeCell(config, seed=seed)) == things, "a seed decides"
    assert counts == {5, 6, 7}


def test_an_option_that_the_driver_does_not_know_is_refused() -> None:
    with pytest.raises(
        InputError, match='driver "fake" does not know the option "gui"; it knows: none; omit'
    ):
        check_driver_options("fake", ["gui"])
    check_driver_options("sim", ["gui"])
    with pytest.raises(
        InputError, match='driver "sim" does not know the option "gain"; it knows: scene, gui;'
    ):
        check_driver_options("sim", ["gui", "gain"])


def test_every_detector_of_the_file_sees_everything_with_its_own_latency(load: Load) -> None:
    late = "{first: {kind: anything, latency: 0.1}, sure: {kind: anything, threshold: 0.95}}"
    fake = FakeCell(load(detectors=late, table__objects="[4, 4]"))
    first = run_skill(Detect(), fake)
    assert first.ticks == 24, "0.1 s at 240 Hz"
    sure = run_skill(Detect(detector="sure"), fake).outputs["detections"]
    assert len(sure.confident) == len(first.outputs["detections"].confident) == 4


@pytest.mark.parametrize("pose", ["scan", "scan_left", "scan_right"])
def test_a_camera_on_the_wrist_sees_the_table_from_its_scan_poses_and_locates_truly(
    load: Load, pose: str
) -> None:
    fake = FakeCell(load("wrist"), seed=1)
    assert fake.cell.camera.name == "wrist"
    assert fake.cell.camera.sees_table(), "home is a scan pose"
    assert run_skill(MoveToScan(pose="left_half"), fake).status == "SUCCESS"
    assert not fake.cell.camera.sees_table()
    assert run_skill(MoveToScan(pose=pose), fake).status == "SUCCESS"
    assert fake.cell.camera.sees_table()
    detections: Detections = run_skill(Detect(), fake).outputs["detections"]
    targets = run_skill(Localize(detections=detections), fake).outputs["targets"]
    assert len(targets) == len(fake.world.objects) >= 3
    for target, thing in zip(targets, fake.world.objects, strict=True):
        assert np.allclose(target.position, thing.position, atol=1e-6)


def test_places_out_of_reach_and_too_many_objects_are_reported(load: Load) -> None:
    assert not list(load_checker("fake").check(load(), Path()))
    wrong = {"bins__blue_bin__position": "[0.2, 0.9, 0.0]", "safe_place": "[0.9, 0.0, 0.0]"}
    errors = list(load_checker("fake").check(load(**wrong, table__objects="[0, 19]"), Path()))
    assert [(".".join(map(str, key)), text.split(":")[0][:34]) for key, text in errors] == [
        ("table.objects", "the table has room for 18 objects,"),
        ("bins.blue_bin.position", 'the bin "blue_bin" is out of reach'),
        ("safe_place", "the safe place is out of reach"),
    ]


@pytest.mark.parametrize(
    ("x", "what"), [(0.358, "right"), (0.373, "elsewhere"), (0.39, "elsewhere"), (0.34, "right")]
)
def test_what_fell_between_two_bins_is_in_the_nearer(load: Load, x: float, what: str) -> None:
    """Tray 1 ends at 0.35 m, and tray 2 begins at 0.38 m."""
    cell = FakeCell(load("kitting", table__objects="[0, 0]"), routes={"bolt": ("tray_1",)})
    cell.world.put("bolt", x, 0.4).is_dropped = True
    assert {count: n for count, n in cell.audit().items() if n and count not in AUDIT_KEYS[-2:]} == {what: 1}


@pytest.mark.parametrize("beside", [None, 0.04], ids=["alone", "beside a cube"])
def test_what_falls_on_the_wall_of_a_bin_falls_into_the_bin(load: Load, beside: float | None) -> None:
    cell = FakeCell(load(table__objects="[0, 0]"))
    bin, radius = cell.cell.bins["red_bin"], cell.cell.classes["cube"].radius
    x, edge = float(bin.position[0]), float(bin.position[1] + bin.size[1] / 2)
    if beside is not None:
        cell.world.put("cube", x, edge + beside)
    cube = cell.world.put("cube", x, edge + 0.01)
    cell.world.held_object = cube
    cell.tool.lose_grip()
    assert bin.contains(cube.position)
    assert beside is not None or np.allclose(cube.position[:2], (x, edge - radius))


@pytest.mark.parametrize("name", ["overhead", "fasteners"])
def test_looks_show_the_yaws_of_the_objects_if_the_tool_needs_them(
    load: Load, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    config = load(name, table__objects="[6, 6]")
    monkeypatch.setattr(Suction, "needs_yaw", True)
    fake = FakeCell(config, seed=3, routes=dict.fromkeys(config.objects, tuple(config.bins)))
    detections: Detections = run_skill(Detect(), fake).outputs["detections"]
    targets = run_skill(Localize(detections=detections), fake).outputs["targets"]
    assert len(targets) == 6
    for thing in fake.world.objects:
        target = min(targets, key=lambda each: float(np.linalg.norm(each.position - thing.position)))
        symmetry = config.build_classes()[thing.label].yaw_symmetry
        assert (target.yaw is None) == (symmetry == 0)
        if target.yaw is not None:
            true_yaw = math.atan2(thing.X_WO.rotation[1, 0], thing.X_WO.rotation[0, 0])
            assert target.yaw.symmetry == symmetry
            assert math.remainder(target.yaw.angle - true_yaw, math.tau / symmetry) == pytest.approx(
                0, abs=1e-6
            )


def test_the_log_of_the_world_keeps_the_yaws(load: Load, tmp_path: Path) -> None:
    first = FakeDriver(load())
    second = FakeDriver(load(), DriverOptions(seed=5))
    first.log_to(tmp_path / "world")
    second.rebuild(tmp_path / "world")
    for each, restored in zip(first.world.objects, second.world.objects, strict=True):
        assert np.allclose(each.X_WO.rotation, restored.X_WO.rotation)
        assert not np.allclose(each.X_WO.rotation, np.eye(3))
