"""The objects a run begins with: random classes, places, turns and colours, lying still."""

from __future__ import annotations

import math

import numpy as np

from executive.cell_config import CellConfig
from executive.errors import InputError
from executive.geometry import Array, Pose, about_z
from executive.sim.models import load_mesh
from executive.sim.settling import DROP, come_to_rest
from executive.sim.stacking import stack
from executive.sim.world import World

TRIES = 2000
"""Places tried for one set of objects before the workspace counts as too small for it."""


def spawn(world: World, config: CellConfig, seed: int, count: int | None = None) -> tuple[int, ...]:
    """Put objects on the table, let them come to rest and return their bodies.

    Args:
        world: Where they go.
        config: Says how many, which classes and where.
        seed: Decides everything random.
        count: How many, or None for a random number in the cell file's range.

    Raises:
        InputError: The workspace has no room for so many.
    """
    rng = np.random.default_rng(seed)
    table = config.table
    if count is None:
        count = int(rng.integers(table.objects[0], table.objects[1], endpoint=True))
    labels = [str(label) for label in rng.choice(list(config.objects), count)]
    meshes = {label: load_mesh(config.objects[label]) for label in sorted(set(labels))}
    bodies = []
    for label, place in zip(labels, _places(config, labels, rng), strict=True):
        model = config.objects[label]
        height = DROP - meshes[label].bottom
        X_WO = Pose(about_z(rng.uniform(0, math.tau)), np.array([*place, height]))
        colour = model.colours[int(rng.integers(len(model.colours)))]
        bodies.append(world.add_object(label, X_WO, colour))
    come_to_rest(world, bodies)
    if table.stacked:
        stack(world, bodies, meshes, table.stacked, rng)
    return tuple(bodies)


def _places(config: CellConfig, labels: list[str], rng: np.random.Generator) -> list[Array]:
    """Return places `(2,)` [m] whose outlines keep the gap, the whole set drawn anew when one gets stuck."""
    low, high = np.array([config.table.x, config.table.y]).T
    radii = [config.objects[label].radius for label in labels]
    places: list[Array] = []
    for _ in range(TRIES):
        if len(places) == len(labels):
            return places
        place, radius = rng.uniform(low, high), radii[len(places)]
        gaps = [np.linalg.norm(place - p) - radius - r for p, r in zip(places, radii, strict=False)]
        if min(gaps, default=math.inf) >= config.table.gap:
            places.append(place)
        elif rng.random() < 0.02:
            places = []
    raise InputError(
        f"{len(labels)} objects ({', '.join(labels)}) found no room on the workspace of cell {config.cell}, "
        f"{high[0] - low[0]:.2f} m by {high[1] - low[1]:.2f} m, {config.table.gap * 1000:.0f} mm apart; "
        "ask for fewer or widen table.x and table.y"
    )
