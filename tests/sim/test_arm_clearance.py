from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pybullet
import pytest

from executive.cell import Via
from executive.cell_config import CellConfig
from executive.errors import Blocked
from executive.geometry import tool_down
from executive.messages import ObjectClass
from executive.mission.parse.cell_file import load_cell
from executive.motion.kinematics import Kinematics
from executive.motion.limits import JointLimits
from executive.motion.planner import Planner
from executive.sim.clearance import PathClearance
from executive.sim.world import World

DUCK = ObjectClass("duck", 0.05, 0.04)


@pytest.fixture(scope="module")
def config(missions: Path) -> CellConfig:
    return load_cell(missions / "cells" / "overhead.yaml")


@pytest.fixture(scope="module")
def clearance(config: CellConfig) -> Iterator[PathClearance]:
    clearance = PathClearance(config)
    yield clearance
    clearance.close()


@pytest.fixture(scope="module")
def kinematics(config: CellConfig) -> Kinematics:
    return Kinematics(config.tool.length, np.radians(config.arm.limits.position_deg))


@pytest.fixture
def at(config: CellConfig, kinematics: Kinematics):
    """Joint positions with the tool centre point at a place."""
    home = np.radians(config.arm.poses_deg["home"])
    return lambda x, y, z: kinematics.nearest_solution(tool_down([x, y, z]), home)


@pytest.fixture(scope="module")
def red_bin(config: CellConfig) -> tuple[float, float, float]:
    """Centre of a bin and the distance of its outer wall along y [m]."""
    bin = config.bins["red_bin"]
    return bin.position[0], bin.position[1], bin.size[1] / 2


def test_a_free_path_passes(clearance: PathClearance, at) -> None:
    clearance.check(np.array([at(0.5, 0.0, z) for z in (0.2, 0.1, 0.03)]))


def test_the_tool_must_not_touch_the_table(clearance: PathClearance, at) -> None:
    with pytest.raises(Blocked, match=r"the tool 0\.00\d m from the table, with the tool at \(0\.500"):
        clearance.check(np.array([at(0.5, 0.0, z) for z in (0.1, 0.003)]))


def test_the_tool_must_not_hit_a_bins_wall(clearance: PathClearance, at, red_bin) -> None:
    with pytest.raises(Blocked, match=r"the tool 0\.\d+ m into red_bin"):
        x, y, half = red_bin
        clearance.check(np.array([at(x, y - away, 0.04) for away in (0.0, half)]))


def test_a_held_object_may_lie_on_the_table_but_not_go_into_it(clearance: PathClearance, at) -> None:
    clearance.check(np.array([at(0.5, 0.0, z) for z in (0.05, 0.1, 0.05)]), DUCK)
    with pytest.raises(Blocked, match=r"the held duck 0\.0\d\d m into the table"):
        clearance.check(np.array([at(0.5, 0.0, z) for z in (0.1, 0.03)]), DUCK)


def test_a_held_object_must_pass_over_a_bins_wall(clearance: PathClearance, at, red_bin) -> None:
    x, y, half = red_bin
    path = [at(x, y - away, 0.09) for away in (half + 0.08, half + 0.04, half)]
    clearance.check(np.array(path))
    with pytest.raises(Blocked, match=r"the held duck .* red_bin"):
        clearance.check(np.array(path), DUCK)


def test_a_held_object_may_be_put_on_a_bins_floor(clearance: PathClearance, at, red_bin) -> None:
    clearance.check(np.array([at(*red_bin[:2], z) for z in (0.15, 0.057)]), DUCK)


def test_a_motion_may_leave_a_place_too_near_but_not_come_nearer(clearance: PathClearance, at) -> None:
    clearance.check(np.array([at(0.5, 0.0, z) for z in (0.003, 0.1)]))
    with pytest.raises(Blocked, match="the table"):
        clearance.check(np.array([at(0.5, 0.0, z) for z in (0.003, 0.001)]))


def test_folding_the_arm_onto_itself_is_blocked(clearance: PathClearance, config: CellConfig) -> None:
    home = np.radians(config.arm.poses_deg["home"])
    folded = np.radians([0, -40, 0, -120, 0, -120, 0])
    with pytest.raises(Blocked, match=r"link 5 .* link 7"):
        clearance.check(np.array([home, folded]))


def test_no_sorting_motion_is_blocked(clearance: PathClearance, config, kinematics) -> None:
    planner = Planner(kinematics, JointLimits.of(config.arm.limits), clearance.check)
    rng = np.random.default_rng(5)
    q = np.radians(config.arm.poses_deg["home"])
    for number, bin in enumerate([*config.bins.values()] * 3):
        x, y = rng.uniform(*config.table.x), rng.uniform(*config.table.y)
        q = planner.plan(q, [Via(np.array([x, y, z])) for z in (0.11, 0.045)]).end
        over = [bin.position[0], bin.position[1], 0.2]
        q = planner.plan(q, [Via(np.array([x, y, 0.15])), Via(np.array(over))], DUCK).end
        if number % 3 == 2:
            q = planner.plan_joints(q, np.radians(config.arm.poses_deg["home"])).end


def test_the_arm_at_home_hides_nothing_of_the_workspace_from_the_fixed_camera(config) -> None:
    world = World(config)
    camera = config.cameras["overhead"]
    assert camera.position is not None
    assert camera.fov_deg is not None
    width, height = camera.width // 4, camera.height // 4
    view = world.client.computeViewMatrix(camera.position, camera.look_at, camera.up)
    projection = world.client.computeProjectionMatrixFOV(camera.fov_deg, width / height, 0.05, 3)
    picture = world.client.getCameraImage(width, height, view, projection, renderer=pybullet.ER_TINY_RENDERER)
    bodies = np.array(picture[4]).reshape(height, width)
    focal = height / 2 / np.tan(np.radians(camera.fov_deg) / 2) / camera.position[2]
    margin = 0.08
    rows = [height / 2 - (x - camera.position[0]) * focal for x in np.add(config.table.x, (-margin, margin))]
    columns = [width / 2 - y * focal for y in np.add(config.table.y, (-margin, margin))]
    workspace = bodies[int(rows[1]) : int(rows[0]) + 1, int(columns[1]) : int(columns[0]) + 1]
    assert np.any(bodies == world.arm)
    assert not np.any(workspace == world.arm)
    world.close()


@pytest.mark.parametrize("cell", ["overhead", "wrist"])
def test_home_is_three_centimetres_clear_of_everything(missions: Path, cell: str) -> None:
    config = load_cell(missions / "cells" / f"{cell}.yaml")
    config = config.model_copy(update={"motion": config.motion.model_copy(update={"margin": 0.03})})
    clearance = PathClearance(config)
    near = clearance.distances(np.radians(config.arm.poses_deg["home"]))
    assert set(near) <= {"link 5 - link 7"}, near  # their usual distance is 29 mm
    clearance.close()
