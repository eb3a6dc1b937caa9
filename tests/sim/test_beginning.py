"""A run's world can be made again without the run."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from executive.cell_config import CellConfig
from executive.events import ignore
from executive.sim.spawn import PartSeeds, first_world
from executive.testing.fake_cell import SilentOperator
from executive.testing.oracle import oracle_cell
from executive.workcell import CellOptions


def test_the_first_world_is_the_one_that_a_cell_of_the_same_seed_begins_with(overhead: CellConfig) -> None:
    options = CellOptions(SilentOperator(), base=Path("."))
    cell = oracle_cell()(overhead, seed=9, routes={}, emit=ignore, options=options)
    world = first_world(overhead, 9)
    assert world.bodies == cell._world.bodies
    for body in world.bodies:
        state = [one.client.getBasePositionAndOrientation(body) for one in (world, cell._world)]
        assert state[0] == state[1]
    assert world.stood == {}
    home = np.radians(overhead.arm.poses_deg["home"])
    joints = [joint[0] for joint in world.client.getJointStates(world.arm, range(7))]
    assert np.allclose(joints, home, atol=1e-3)
    cell.close()
    world.close()


def test_the_parts_draw_from_seeds_of_their_own() -> None:
    seeds = PartSeeds.of(5)
    assert len({seeds.objects, seeds.camera, seeds.detectors}) == 3
    assert PartSeeds.of(5) == seeds != PartSeeds.of(6)
