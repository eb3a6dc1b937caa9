"""Bins of a cell file that are in the way of each other, of the objects, or of the safe place."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from executive.cell_config import BinConfig, CellConfig
from executive.geometry import Array
from executive.messages import BIN_THICKNESS
from executive.mission.parse.validate import KeyPath

ROUNDING = 1e-6
"""Overlap of two bins that share a wall, by rounding [m]."""


def find_overlaps(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield a key and a sentence for each pair of bins that overlap, and for each bin near the objects.

    The centre of an object may be anywhere in the workspace and at the safe place, so the largest radius of
    an object must stay free around both.
    """
    radius = max(kind.radius for kind in config.objects.values())
    outlines = {name: _outline(bin) for name, bin in config.bins.items()}
    safe_place = np.array([config.safe_place[:2], config.safe_place[:2]])
    workspace = np.array([config.table.x, config.table.y]).T
    margin = np.array([[-radius], [radius]])
    for (name, outline), (other, other_outline) in combinations(outlines.items(), 2):
        if (overlap := _overlap(outline, other_outline)) > ROUNDING:
            yield (
                ("bins", other, "position"),
                f'the bins "{name}" and "{other}" overlap by {overlap:.3f} m with their walls; move one',
            )
    for name, outline in outlines.items():
        if (overlap := _overlap(outline, workspace + margin)) > ROUNDING:
            yield (
                ("bins", name, "position"),
                f'the bin "{name}" reaches {overlap:.3f} m into the workspace (table.x, table.y) and the '
                f"{radius:.3f} m that objects need around it; move the bin or the workspace",
            )
        if (overlap := _overlap(outline, safe_place + margin)) > ROUNDING:
            yield (
                ("safe_place",),
                f'the bin "{name}" reaches {overlap:.3f} m into the {radius:.3f} m that an object needs '
                "around the safe place; move the safe place",
            )


def _outline(bin: BinConfig) -> Array:
    """Return the lowest and the highest x and y of a bin with its walls, `(2, 2)` [m]."""
    centre, half = np.array(bin.position[:2]), np.array(bin.size[:2]) / 2 + BIN_THICKNESS
    return np.array([centre - half, centre + half])


def _overlap(one: Array, other: Array) -> float:
    """Return the overlap of two rectangles along x or y, whichever is smaller [m]; at most 0 for none."""
    return float(np.min(np.minimum(one[1], other[1]) - np.maximum(one[0], other[0])))
