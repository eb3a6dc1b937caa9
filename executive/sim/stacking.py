"""Putting objects on top of others, where they stay up."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from executive.geometry import Pose, about_z
from executive.sim.models import Mesh
from executive.sim.settling import DROP, come_to_rest
from executive.sim.world import World

OFFSET = 0.004
"""Largest distance of an object's axis from that of the one it is put on, along x and y [m]."""
NUDGE = 0.1
"""Speed at which it is pushed aside to see whether it stays [m/s]; friction stops that within 1 mm."""
MOVED = 0.005
"""What moves further than this did not stay [m]."""


def stack(
    world: World, bodies: Sequence[int], meshes: Mapping[str, Mesh], share: float, rng: np.random.Generator
) -> None:
    """Put each object on another one with probability `share`, if there is one that carries it.

    Which others do is found out by trying: what falls, also when nudged, is put back where it lay, and all
    else too. So a ball is carried by nothing and carries nothing. No object gets on one that lies on
    another, and none has two on top.

    Args:
        world: Where they lie, at rest.
        bodies: The objects.
        meshes: Shape of each class.
        share: 0 to 1.
        rng: Decides which, where, and how they are turned.
    """
    free = set(bodies)
    for upper in bodies:
        if rng.random() >= share or upper not in free:
            continue
        for lower in map(int, rng.permutation(sorted(free - {upper}))):
            if _put_on(world, upper, lower, meshes, rng):
                free -= {upper, lower}
                break


def _put_on(
    world: World, upper: int, lower: int, meshes: Mapping[str, Mesh], rng: np.random.Generator
) -> bool:
    """Put one object on another, and tell whether it stayed; if not, all is again as it was."""
    before = {body: world.object_pose(body) for body in world.bodies}
    base = before[lower].position
    height = base[2] + meshes[world.bodies[lower]].top - meshes[world.bodies[upper]].bottom + DROP
    place = np.array([*(base[:2] + rng.uniform(-OFFSET, OFFSET, 2)), height])
    goal = {**before, upper: Pose(about_z(rng.uniform(0, math.tau)), place)}
    world.place_object(upper, goal[upper])
    come_to_rest(world, list(goal), lambda: _moved(world, goal))
    heading = rng.uniform(0, math.tau)
    world.client.resetBaseVelocity(upper, [NUDGE * math.cos(heading), NUDGE * math.sin(heading), 0.0])
    come_to_rest(world, list(goal), lambda: _moved(world, goal))
    if not _moved(world, goal):
        return True
    for body, X_WO in before.items():
        world.place_object(body, X_WO)
    return False


def _moved(world: World, goal: Mapping[int, Pose]) -> bool:
    """Tell whether any body is far from where it should be."""
    return any(
        float(np.linalg.norm(world.object_pose(body).position - X_WO.position)) > MOVED
        for body, X_WO in goal.items()
    )
