"""What a run begins with in simulation: the seeds of its parts, and the world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from executive.cell_config import CellConfig
from executive.sim.spawn import spawn
from executive.sim.world import World


@dataclass(frozen=True)
class PartSeeds:
    """What each part of a simulated cell draws its chance from.

    Attributes:
        objects: Decides which objects lie where.
        camera: Decides the camera's noise.
        detectors: Decides what detectors leave to chance.
    """

    objects: int
    camera: int
    detectors: int

    @staticmethod
    def of(seed: int) -> PartSeeds:
        """Return the seeds that follow from a run's."""
        parts = np.random.SeedSequence(seed).spawn(3)
        return PartSeeds(*(int(part.generate_state(1)[0]) for part in parts))


def first_world(config: CellConfig, seed: int, *, gui: bool = False) -> World:
    """Return the world as a run of this seed finds it: arm at `home`, its objects at rest on the table.

    Raises:
        InputError: The workspace has no room for the objects.
    """
    world = World(config, gui=gui)
    world.set_arm(np.radians(config.arm.poses_deg["home"]))
    spawn(world, config, PartSeeds.of(seed).objects)
    world.stood.clear()
    return world
