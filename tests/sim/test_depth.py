"""The depth sensor: true without noise, noisy as its figures say, blind beside edges."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from executive.cell_config import CellConfig, DepthConfig
from executive.geometry import Pose
from executive.sim.camera import CELL_LIGHT, camera_pose, render, sense
from executive.sim.world import World
from executive.vision.camera_model import calibrated

Build = Callable[[CellConfig], World]

PERFECT = DepthConfig(floor=0, growth=0, grain=0, step=0, edge_dropout=0, dropout=0)


def changed(**figures: float) -> DepthConfig:
    return PERFECT.model_copy(update=figures)


def flat(distance: float) -> np.ndarray:
    return np.full((200, 300), distance)


def test_a_render_knows_how_far_everything_is(build: Build, overhead: CellConfig) -> None:
    world, config = build(overhead), overhead.cameras["overhead"]
    world.set_arm(np.radians(overhead.arm.poses_deg["home"]))
    cube = world.add_object("cube", Pose.of([0.5, 0.0, 0.025]), (1, 0, 0))
    matrix, _ = calibrated(config)
    shot = render(world, matrix, camera_pose(world, config), config.table_view, CELL_LIGHT)
    assert shot.depth[shot.bodies == cube] == pytest.approx(1.15, abs=1e-4)
    assert shot.depth[shot.bodies == world.table] == pytest.approx(1.2, abs=1e-4)
    away = Pose(np.eye(3), np.array([0, 0, 1.2]))
    sky = render(world, matrix, away, (0, 0, 64, 64), CELL_LIGHT)
    assert np.isinf(sky.depth).all()


def test_a_perfect_sensor_measures_the_truth_and_nothing_of_the_sky() -> None:
    true = flat(1.2)
    true[:, 200:] = np.inf
    measured = sense(true, PERFECT, np.random.default_rng(1))
    assert (measured[:, :200] == 1.2).all()
    assert np.isnan(measured[:, 200:]).all()


@pytest.mark.parametrize("grain", [0.0, 1.0, 2.0])
@pytest.mark.parametrize("distance", [0.5, 1.0, 2.0])
def test_noise_is_a_floor_and_grows_with_the_square_of_the_distance(grain: float, distance: float) -> None:
    config = changed(floor=0.001, growth=0.004, grain=grain)
    error = sense(flat(distance), config, np.random.default_rng(1)) - distance
    assert error.std() == pytest.approx(0.001 + 0.004 * distance**2, rel=0.02)
    assert abs(error.mean()) < error.std() / 10


def test_neighbours_err_alike_where_there_is_grain() -> None:
    def alike(grain: float) -> float:
        error = sense(flat(1.0), changed(floor=0.005, grain=grain), np.random.default_rng(1)) - 1.0
        return float(np.corrcoef(error[:, 1:].ravel(), error[:, :-1].ravel())[0, 1])

    assert abs(alike(0.0)) < 0.02
    # The autocorrelation of noise blurred by s pixels is exp(-d² / 4 s²).
    assert alike(1.0) == pytest.approx(np.exp(-1 / 4), abs=0.05)


def test_distances_are_whole_multiples_of_the_step() -> None:
    measured = sense(flat(1.0), changed(floor=0.005, step=0.002), np.random.default_rng(1))
    assert np.unique(np.round(measured / 0.002, 6) % 1).tolist() == [0.0]


def test_pixels_drop_out_beside_edges_and_a_few_anywhere() -> None:
    true = flat(1.2)
    true[:, 150:] = 1.15
    config = changed(edge=0.02, edge_width=2, edge_dropout=0.7, dropout=0.01)
    lost = np.isnan(sense(true, config, np.random.default_rng(1)))
    assert lost[:, 147:153].mean() == pytest.approx(0.7, abs=0.05)
    assert lost[:, :147].mean() == pytest.approx(0.01, abs=0.005)
    assert lost[:, 153:].mean() == pytest.approx(0.01, abs=0.005)
    smaller = np.where(true < 1.2, 1.19, true)
    assert np.isnan(sense(smaller, config, np.random.default_rng(1))).mean() == pytest.approx(0.01, abs=0.005)
