from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from executive.cell_config import CellConfig
from executive.geometry import Pose
from executive.sim.world import World

DOWN = np.array([0.0, 0.0, -1.0])


@pytest.fixture
def world(build: Callable[[CellConfig], World], overhead: CellConfig) -> World:
    world = build(overhead)
    world.add_object("cube", Pose.of([0.5, 0.1, 0.025]), (1, 0, 0))
    return world


def test_a_ray_ends_at_the_first_thing_in_its_way(world: World) -> None:
    assert world.cast_ray(np.array([0.5, 0.1, 1.2]), DOWN) == pytest.approx([0.5, 0.1, 0.05], abs=1e-3)
    assert world.cast_ray(np.array([0.6, 0.1, 1.2]), DOWN) == pytest.approx([0.6, 0.1, 0.0], abs=1e-3)


def test_the_arm_and_its_tool_are_air_to_it(world: World) -> None:
    world.set_arm(np.radians([0, 33, 0, -88, 0, 59, 0]))
    elbow = world.client.getLinkState(world.arm, 3)[0]
    for place in ((0.0, 0.0, 0.0), elbow, world.tool_pose().position):
        above = np.array([place[0] + 0.001, place[1], 1.5])
        hit, first = world.cast_ray(above, DOWN), world.client.rayTest(above, above + 5 * DOWN)[0]
        assert first[0] == world.arm
        assert hit is not None
        assert hit == pytest.approx([*above[:2], 0.0], abs=1e-3)


def test_a_ray_into_the_sky_hits_nothing(world: World) -> None:
    assert world.cast_ray(np.array([0.5, 0.1, 1.2]), -DOWN) is None
