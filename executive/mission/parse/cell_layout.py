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
"""Largest overlap that is accepted [m]: the outer walls of two bins may touch."""


def find_overlaps(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield a key and a message for each bin that overlaps a bin, the workspace or the safe place from above.

    The centre of an object may be anywhere in the workspace and at the safe place, so the largest radius of
    an object must stay free around both.
    """
    radius = max(kind.radius for kind in config.objects.values())
    outlines = {name: _outline(bin) for name, bin in config.bins.items()}
    safe_place = np.array([config.safe_place[:2], config.safe_place[:2]])
    workspace = np.array([config.table.x, config.table.y]).T
    for (name, outline), (other, other_outline) in combinations(outlines.items(), 2):
        if (shift := _find_shift(outline, other_outline)) > MAX_OVERLAP:
            yield (
                ("bins", other, "position"),
                f'the bins "{name}" and "{other}" overlap; move one of them by {shift:.3f} m',
            )
    for name, outline in outlines.items():
        if (shift := _find_shift(outline, workspace, radius)) > MAX_OVERLAP:
            yield (
                ("bins", name, "position"),
                f'the bin "{name}" is too near to the workspace (table.x, table.y), around which objects '
                f"need {radius:.3f} m; move the bin or the workspace by {shift:.3f} m",
            )
        if (shift := _find_shift(outline, safe_place, radius)) > MAX_OVERLAP:
            yield (
                ("safe_place",),
                f'the bin "{name}" is too near to the safe place, around which an object needs {radius:.3f} '
                f"m; move the safe place by {shift:.3f} m",
            )


def _outline(bin: BinConfig) -> Array:
    """Return the lowest and the highest x and y of a bin with its walls, `(2, 2)` [m]."""
    centre, half = np.array(bin.position[:2]), np.array(bin.size[:2]) / 2 + BIN_THICKNESS
    return np.array([centre - half, centre + half])


def _find_shift(one: Array, other: Array, required: float = 0.0) -> float:
    """Return the shift along x or y that brings two rectangles to a distance [m]; 0 for none."""
    gaps = np.maximum(one[0] - other[1], other[0] - one[1])
    is_apart = gaps.max() >= 0 and np.linalg.norm(np.maximum(gaps, 0.0)) >= required
    return 0.0 if is_apart else float(required - gaps.max())
