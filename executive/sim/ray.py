"""What a ray through the simulated world hits."""

from __future__ import annotations

import numpy as np

from executive.geometry import Array
from executive.sim.world import World

LENGTH = 5.0
"""How far a ray goes [m]."""
PAST = 1e-4
"""How far behind the arm's surface a ray goes on [m]."""


def cast(world: World, origin: Array, direction: Array) -> Array | None:
    """Return the first point `(3,)` [m] that a ray hits, the arm and its tool being air, or None."""
    end = origin + LENGTH * direction / np.linalg.norm(direction)
    start = origin
    while True:
        body, _, share, point, _ = world.client.rayTest(start, end)[0]
        if body != world.arm:
            return np.array(point) if body >= 0 else None
        start = start + share * (end - start) + PAST * (end - start) / np.linalg.norm(end - start)
