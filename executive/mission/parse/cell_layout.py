"""Checks that the bins of a cell file overlap neither each other, nor the workspace, nor the safe place."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from executive.cell.bins import BIN_THICKNESS
from executive.cell.config import BinConfig, CellConfig
from executive.geometry import Array
from executive.mission.parse.validate import KeyPath

MAX_OVERLAP = 0.0005
"""Maximum overlap without an error [m], for rounding errors of bins whose outer walls touch."""


def find_overlaps(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield keys and message for each bin that is too close to another bin, the workspace or the safe place.

    The centre of an object may be anywhere in the workspace and at the safe place, so each bin must be at
    least the radius of the largest object away from the workspace and the safe place.
    """
    radius = max(object_config.radius for object_config in config.objects.values())
    outlines = {name: _compute_outline(bin) for name, bin in config.bins.items()}
    safe_place = np.array([config.safe_place[:2], config.safe_place[:2]])
    workspace = np.array([config.table.x, config.table.y]).T
    for (name, outline), (other_name, other_outline) in combinations(outlines.items(), 2):
        if (shift := _compute_shift(outline, other_outline)) > MAX_OVERLAP:
            message = f'the bins "{name}" and "{other_name}" overlap; move one of them by {shift:.3f} m'
            yield ("bins", other_name, "position"), message
    for name, outline in outlines.items():
        rule = f'the bin "{name}" must be at least {radius:.3f} m (radius of the largest object) away from'
        if (shift := _compute_shift(outline, workspace, radius)) > MAX_OVERLAP:
            remedy = f"move the bin or the workspace by {shift:.3f} m"
            yield ("bins", name, "position"), f"{rule} the workspace (table.x, table.y); {remedy}"
        if (shift := _compute_shift(outline, safe_place, radius)) > MAX_OVERLAP:
            yield ("safe_place",), f"{rule} the safe place; move the safe place by {shift:.3f} m"


def _compute_outline(bin: BinConfig) -> Array:
    """Return the rows minimum x, y and maximum x, y of a bin with its walls, `(2, 2)` [m]."""
    centre, half_size = np.array(bin.position[:2]), np.array(bin.size[:2]) / 2 + BIN_THICKNESS
    return np.array([centre - half_size, centre + half_size])


def _compute_shift(outline: Array, other_outline: Array, min_distance: float = 0.0) -> float:
    """Return the shift along x or y after which two outlines `(2, 2)` have the minimum distance [m], or 0."""
    # The gap along an axis is negative if the outlines overlap along this axis.
    gaps = np.maximum(outline[0] - other_outline[1], other_outline[0] - outline[1])
    is_apart = gaps.max() >= 0 and np.linalg.norm(np.maximum(gaps, 0.0)) >= min_distance
    return 0.0 if is_apart else float(min_distance - gaps.max())
