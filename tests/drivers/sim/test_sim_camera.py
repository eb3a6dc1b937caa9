from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from executive.cell.config import CellConfig
from executive.cell.device_config import DepthConfig
from executive.cell.devices import StepClock
from executive.cell.frame import BinAppearance
from executive.drivers.sim.camera import CELL_LIGHT, SimCamera, add_depth_noise, get_camera_pose, render
from executive.drivers.sim.models import load_mesh
from executive.drivers.sim.world import World
from executive.geometry import Pose, rotate_about_z
from executive.mission.cell_file import load_cell
from executive.motion.joints import build_kinematics
from executive.perception.camera_model import compute_calibration, project
from executive.station.camera import CellCamera, Robot

Build = Callable[[CellConfig], World]


def at_scan_pose(build: Build, config: CellConfig) -> tuple[World, str]:
    (name,) = config.cameras
    world = build(config)
    world.set_joint_positions(np.radians(config.arm.poses_deg[config.cameras[name].scan_poses[0]]))
    return world, name


def test_projected_meshes_agree_with_the_rendered_silhouettes(build: Build, overhead: CellConfig) -> None:
    config = overhead
    world, name = at_scan_pose(build, config)
    camera = config.cameras[name]
    for i in range(9):
        label = list(config.objects)[i % 3]
        mesh = load_mesh(config.objects[label])
        place = np.array([0.44 + 0.09 * (i % 3), -0.18 + 0.18 * (i // 3), -mesh.bottom])
        world.add_object(label, Pose(rotate_about_z(0.7 * i), place), (1, 0, 0))
    matrix, X_WC = compute_calibration(camera)[0], get_camera_pose(world, camera)
    left, top, _, _ = camera.table_view
    bodies = render(world, matrix, X_WC, camera.table_view, CELL_LIGHT).segmentation
    for body, label in world.labels.items():
        rows, columns = np.nonzero(bodies == body)
        seen = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
        pixels = project(
            matrix, X_WC, world.get_object_pose(body).apply(load_mesh(config.objects[label]).vertices)
        )
        expected = [*(pixels.min(axis=0) - (left, top)), *(pixels.max(axis=0) - (left, top))]
        # Half a pixel is what sampling at pixel centres costs on a straight edge, a bit more on a tip.
        assert np.abs(np.array(seen) - expected).max() < 1.0, label
        assert abs(np.mean(np.array(seen) - expected)) < 0.3, label


def test_a_seed_repeats_the_noise_of_images_and_depth_and_a_depth_sensor_changes_no_image(
    build: Build, overhead: CellConfig
) -> None:
    world, name = at_scan_pose(build, overhead)
    cube = world.add_object("cube", Pose.of([0.5, 0.0, 0.025]), (1, 0, 0))
    camera = overhead.cameras[name].model_copy(update={"depth": DepthConfig()})
    deep = overhead.model_copy(update={"cameras": {name: camera}})
    clock = StepClock(step=1.5)
    clock.wait_for_tick()
    without, one, same, other = (
        SimCamera(world, config, clock, seed, CELL_LIGHT)
        for config, seed in ((overhead, 7), (deep, 7), (deep, 7), (deep, 8))
    )
    first = one.capture()
    assert first.depth is not None
    assert (first.stamp, first.visible, first.true_detections) == (1.5, None, None)
    assert (first.colour == without.capture().colour).all()
    shot = render(world, *one.get_true_view(), (0, 0, 640, 480), CELL_LIGHT)
    for body, distance in ((cube, 1.15), (world.table, 1.2)):
        assert shot.depth[shot.segmentation == body] == pytest.approx(distance, abs=1e-4)
        assert np.nanmedian(first.depth[shot.segmentation == body]) == pytest.approx(distance, abs=0.003)
    again, second, others = same.capture(), one.capture(), other.capture()
    assert one.image_count == 2
    assert np.abs(first.colour.astype(int) - second.colour).mean() > 0.5
    assert [(one.colour == first.colour).all() for one in (again, second, others)] == [True, False, False]
    same_depth = [np.array_equal(first.depth, one.depth, equal_nan=True) for one in (again, second, others)]
    assert same_depth == [True, False, False]


PERFECT = DepthConfig(floor=0, growth=0, grain=0, step=0, edge_dropout=0, dropout=0)


def changed(**figures: float) -> DepthConfig:
    return PERFECT.model_copy(update=figures)


def flat(distance: float) -> np.ndarray:
    return np.full((200, 300), distance)


@pytest.mark.parametrize("grain", [0.0, 1.0, 2.0])
@pytest.mark.parametrize("distance", [0.5, 1.0, 2.0])
def test_noise_is_a_floor_and_grows_with_the_square_of_the_distance(grain: float, distance: float) -> None:
    config = changed(floor=0.001, growth=0.004, grain=grain)
    error = add_depth_noise(flat(distance), config, np.random.default_rng(1)) - distance
    assert error.std() == pytest.approx(0.001 + 0.004 * distance**2, rel=0.02)
    assert abs(error.mean()) < error.std() / 10


def test_neighbours_err_alike_where_there_is_grain() -> None:
    def alike(grain: float) -> float:
        error = add_depth_noise(flat(1.0), changed(floor=0.005, grain=grain), np.random.default_rng(1)) - 1.0
        return float(np.corrcoef(error[:, 1:].ravel(), error[:, :-1].ravel())[0, 1])

    assert abs(alike(0.0)) < 0.02
    # The autocorrelation of noise blurred by s pixels is exp(-d² / 4 s²).
    assert alike(1.0) == pytest.approx(np.exp(-1 / 4), abs=0.05)


def test_pixels_drop_out_beside_edges_and_a_few_anywhere() -> None:
    true = flat(1.2)
    true[:, 150:] = 1.15
    config = changed(edge=0.02, edge_width=2, edge_dropout=0.7, dropout=0.01)
    lost = np.isnan(add_depth_noise(true, config, np.random.default_rng(1)))
    assert lost[:, 147:153].mean() == pytest.approx(0.7, abs=0.05)
    assert lost[:, :147].mean() == pytest.approx(0.01, abs=0.005)
    assert lost[:, 153:].mean() == pytest.approx(0.01, abs=0.005)
    smaller = np.where(true < 1.2, 1.19, true)
    assert np.isnan(add_depth_noise(smaller, config, np.random.default_rng(1))).mean() == pytest.approx(
        0.01, abs=0.005
    )


@pytest.mark.parametrize("pose", ["scan", "scan_left", "scan_right"])
def test_the_scan_poses_of_the_wrist_camera_show_the_floors_of_all_bins(
    build: Build, wrist: CellConfig, pose: str
) -> None:
    world = build(wrist)
    q = np.radians(wrist.arm.poses_deg[pose])
    world.set_joint_positions(q)
    still: Any = SimpleNamespace(q=q, holding=False)
    robot = Robot(still, still)
    device = SimCamera(world, wrist, StepClock(step=1.5), 0, CELL_LIGHT)
    camera = CellCamera(wrist, device, robot, robot, build_kinematics(wrist))
    appearances = camera.inspect_bins(camera.capture())
    assert appearances == dict.fromkeys(wrist.bins, BinAppearance("", 0.0, is_whole=True))


def test_the_palm_of_a_wide_hand_is_not_visible(build: Build, missions: Path) -> None:
    config = load_cell(missions / "cells" / "panda_hand.yaml")
    world = build(config)
    q = np.radians(config.arm.poses_deg["home"])
    still: Any = SimpleNamespace(q=q, holding=False)
    robot = Robot(still, still)
    device = SimCamera(world, config, StepClock(step=1.5), 0, CELL_LIGHT)
    frame = CellCamera(config, device, robot, robot, build_kinematics(config)).capture()
    ends = world.get_tool_pose().apply(np.array([(0.0, -0.1, -0.05), (0.0, 0.1, -0.05)]))
    columns, rows = project(frame.matrix, frame.X_WC, ends).round().astype(int).T
    assert not frame.visible[rows, columns].any()
