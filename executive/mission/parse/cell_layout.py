"""Checks that no bin of a cell file overlaps another bin, the workspace or the safe place."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from executive.cell.bins import BIN_THICKNESS
from executive.cell.config import BinConfig, CellConfig
from executive.geometry import Array
from executive.mission.parse.validate import KeyPath

MAX_OVERLAP = 0.0005
"""Maximum overlap that is no error [m], so that the outer walls of two bins may touch."""


def find_overlaps(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each bin that, seen from above, overlaps a bin, the workspace or safe place.

    An object may have its centre anywhere in the workspace and at the safe place, so the distance of each bin
    from both must be at least the radius of the largest object.
    """
    radius = max(kind.radius for kind in config.objects.values())
    outlines = {name: _compute_outline(bin) for name, bin in config.bins.items()}
    safe_place = np.array([config.safe_place[:2], config.safe_place[:2]])
    workspace = np.array([config.table.x, config.table.y]).T
    for (name, outline), (other, other_outline) in combinations(outlines.items(), 2):
        if (shift := _compute_shift(outline, other_outline)) > MAX_OVERLAP:
            yield (
                ("bins", other, "position"),
                f'the bins "{name}" and "{other}" overlap; move one of them by {shift:.3f} m',
            )
    for name, outline in outlines.items():
        if (shift := _compute_shift(outline, workspace, radius)) > MAX_OVERLAP:
            yield (
                ("bins", name, "position"),
                f'the bin "{name}" must be at least {radius:.3f} m (radius of the largest object) away '
                f"from the workspace (table.x, table.y); move the bin or the workspace by {shift:.3f} m",
            )
        if (shift := _compute_shift(outline, safe_place, radius)) > MAX_OVERLAP:
            yield (
                ("safe_place",),
                f'the bin "{name}" must be at least {radius:.3f} m (radius of the largest object) away '
                f"from the safe place; move the safe place by {shift:.3f} m",
            )


def _compute_outline(bin: BinConfig) -> Array:
    """Return the minimum and the maximum x and y of a bin with its walls, `(2, 2)` [m]."""
    centre, half_size = np.array(bin.position[:2]), np.array(bin.size[:2]) / 2 + BIN_THICKNESS
    return np.array([centre - half_size, centre + half_size])


def _compute_shift(outline: Array, other: Array, distance: float = 0.0) -> float:
    """Return the shift along x or y that gives two outlines `(2, 2)` a distance [m]; 0 if they have it."""
    gaps = np.maximum(outline[0] - other[1], other[0] - outline[1])
    is_apart = gaps.max() >= 0 and np.linalg.norm(np.maximum(gaps, 0.0)) >= distance
    return 0.0 if is_apart else float(distance - gaps.max())
