"""The simulated world as a person sees it, against what the simulator itself says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from executive.cell.config import CellConfig
from executive.drivers.sim.spawn import spawn_objects
from executive.drivers.sim.world import SimVisuals, World


@pytest.fixture
def world(overhead: CellConfig):
    world = World(overhead)
    spawn_objects(world, 3)
    yield world
    world.close()


def test_the_arm_is_where_its_joints_put_it(world: World) -> None:
    visuals = SimVisuals(world)
    before = visuals.poses()
    assert np.allclose(before["link 8"].position, world.get_flange_pose().position, atol=1e-6)
    for body in world.labels:
        assert before[f"object {body}"].position[:2] == pytest.approx(
            world.get_object_pose(body).position[:2], abs=1e-6
        )
    world.set_joint_positions(np.radians([20, 40, 10, -70, 5, 60, 15]))
    after = visuals.poses()
    assert np.allclose(after["link 8"].position, world.get_flange_pose().position, atol=1e-6)
    assert not np.allclose(before["link 4"].position, after["link 4"].position, atol=0.01)
    walls = [shape for shape in visuals.shapes if shape.kind == "box"]
    assert len(walls) == 5 * len(world.config.bins)
    assert walls[0].X_BS.position == pytest.approx((0.24, -0.48, 0.0025))
    body, neck = [shape for shape in visuals.shapes if shape.kind == "cylinder"]
    assert neck.size[0] == pytest.approx(2 * world.config.tool.cup_radius)
    assert body.size[2] + neck.size[2] == pytest.approx(world.config.tool.length)
    assert all(Path(shape.file).is_file() for shape in visuals.shapes if shape.kind == "mesh")
