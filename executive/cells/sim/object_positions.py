"""Random positions of objects on the workspace, and the check that the workspace has room for them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.workcell import KeyPath
from executive.errors import InputError
from executive.geometry import Array

MAX_POSITION_ATTEMPTS = 2000
"""Number of random positions for one set of objects after which the workspace counts as too small."""
OBJECT_SET_COUNT = 5
"""Number of random sets of objects for which `find_object_count_errors` tries to find positions."""


def find_object_count_errors(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield the key and an error if no random set with the maximum number of objects fits the workspace."""
    message = ""
    for seed in range(OBJECT_SET_COUNT):
        rng = np.random.default_rng(seed)
        labels = [str(label) for label in rng.choice(list(config.objects), config.table.objects[1])]
        try:
            draw_positions(config, [config.objects[label].radius for label in labels], rng)
            return
        except InputError as error:
            message = str(error)
    yield ("table", "objects"), message


def find_max_object_count(config: CellConfig, limit: int) -> int:
    """Return the maximum number of objects, up to `limit`, for which the workspace has room."""
    for count in range(limit, 0, -1):
        table = config.table.model_copy(update={"objects": (0, count)})
        if not any(find_object_count_errors(config.model_copy(update={"table": table}))):
            return count
    return 0


def draw_positions(config: CellConfig, radii: Sequence[float], rng: np.random.Generator) -> list[Array]:
    """Return random positions `(2,)` [m] of circles with the given radii [m] and the gap of the cell file.

    After a failed attempt to position a circle, all circles are positioned again with a probability of 2 %.

    Raises:
        InputError: The workspace has no room for the circles.
    """
    low, high = np.array([config.table.x, config.table.y]).T
    positions: list[Array] = []
    for _ in range(MAX_POSITION_ATTEMPTS):
        if len(positions) == len(radii):
            return positions
        position, radius = rng.uniform(low, high), radii[len(positions)]
        circles = zip(positions, radii, strict=False)
        gaps = [np.linalg.norm(position - centre) - radius - other_radius for centre, other_radius in circles]
        if min(gaps, default=math.inf) >= config.table.gap:
            positions.append(position)
        elif rng.random() < 0.02:
            positions = []
    raise InputError(
        f"{len(radii)} objects found no room on the workspace of cell {config.cell}, "
        f"{high[0] - low[0]:.2f} m by {high[1] - low[1]:.2f} m, {config.table.gap * 1000:.0f} mm apart; "
        "ask for fewer or widen table.x and table.y"
    )
