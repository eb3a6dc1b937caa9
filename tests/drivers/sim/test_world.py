from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from executive.cell.config import CellConfig
from executive.drivers.sim.world import World
from executive.geometry import Pose

Build = Callable[[CellConfig], World]


def test_a_ray_ends_at_the_first_thing_but_the_arm(build: Build, overhead: CellConfig) -> None:
    world, down = build(overhead), np.array([0.0, 0.0, -2.0])
    world.add_object("cube", Pose.of([0.5, 0.1, 0.025]), (1, 0, 0))
    world.set_joint_positions(np.radians([0, 33, 0, -88, 0, 59, 0]))
    elbow = world.client.getLinkState(world.arm, 3)[0]
    for (x, y), height in (((0.5, 0.1), 0.05), ((0.6, 0.1), 0.0), (elbow[:2], 0.0), ((0.001, 0.0), 0.0)):
        assert world.cast_ray(np.array([x, y, 1.5]), down) == pytest.approx([x, y, height], abs=1e-3)
    assert world.cast_ray(np.array([0.5, 0.1, 1.2]), -down) is None
    assert world.cast_ray(np.array([0.5, 0.1, 5.1]), down) is None, "5 m is as far as it goes"
