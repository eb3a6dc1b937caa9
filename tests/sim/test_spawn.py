from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest

from executive.cell_config import CellConfig
from executive.errors import InputError
from executive.sim.spawn import spawn
from executive.sim.world import World

Build = Callable[[CellConfig], World]


@pytest.mark.parametrize("seed", range(4))
def test_objects_stand_still_apart_and_inside_the_workspace(
    build: Build, overhead: CellConfig, seed: int
) -> None:
    world, table = build(overhead), overhead.table
    bodies = spawn(world, overhead, seed)
    assert table.objects[0] <= len(bodies) <= table.objects[1]
    assert list(world.bodies) == list(bodies)
    poses = {body: world.object_pose(body) for body in bodies}
    for pose in poses.values():
        assert table.x[0] - 0.005 <= pose.position[0] <= table.x[1] + 0.005
        assert table.y[0] - 0.005 <= pose.position[1] <= table.y[1] + 0.005
    for (a, X_WA), (b, X_WB) in combinations(poses.items(), 2):
        radii = sum(overhead.objects[world.bodies[body]].radius for body in (a, b))
        distance = float(np.linalg.norm(X_WA.position[:2] - X_WB.position[:2]))
        assert distance >= radii + table.gap - 0.005
    for _ in range(240):
        world.step()
    for body, before in poses.items():
        assert world.object_pose(body).position == pytest.approx(before.position, abs=1e-3)
        if world.bodies[body] != "sphere":
            assert world.object_pose(body).rotation[2, 2] > 0.999


def test_every_class_and_many_colours_turn_up(build: Build, overhead: CellConfig) -> None:
    world = build(overhead)
    for seed in range(3):
        for body in spawn(world, overhead, seed):
            assert (
                tuple(round(value, 3) for value in world.client.getVisualShapeData(body)[0][7][:3])
                in overhead.objects[world.bodies[body]].colours
            )
    assert set(world.bodies.values()) == set(overhead.objects)


def test_the_seed_decides(build: Build, overhead: CellConfig) -> None:
    worlds = [build(overhead) for _ in range(3)]
    places = []
    for world, seed in zip(worlds, (1, 1, 2), strict=True):
        places.append([world.object_pose(body).rounded() for body in spawn(world, overhead, seed, count=4)])
    assert places[0] == places[1] != places[2]


def test_too_many_objects_are_refused_with_what_to_change(build: Build, overhead: CellConfig) -> None:
    with pytest.raises(InputError, match=r"100 objects .* found no room .* ask for fewer or widen table\.x"):
        spawn(build(overhead), overhead, seed=1, count=100)
