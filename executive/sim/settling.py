"""Letting loose objects come to rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from executive.sim.world import World

DROP = 0.002
"""Height over what carries it at which an object is let go [m]."""
STILL = 0.002
"""Speed under which an object counts as still [m/s]."""
LEAST, MOST = 60, 480
"""Physics steps given to settle: at least, for nothing moves in the first ones, and at most."""


def come_to_rest(world: World, bodies: Sequence[int], enough: Callable[[], bool] = lambda: False) -> None:
    """Step until every body has come to rest, or for two seconds, or until `enough` holds."""
    for step in range(MOST):
        world.step()
        speeds = [np.linalg.norm(world.client.getBaseVelocity(body)[0]) for body in bodies]
        if (step >= LEAST and max(speeds, default=0.0) < STILL) or enough():
            return
