"""Bins, object classes, and derived heights and sizes of a cell file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cell.config import BinConfig, CellConfig, ObjectConfig
from executive.cell.objects import ObjectClass
from executive.cell.workcell import KeyPath
from executive.errors import Unreachable
from executive.geometry import Array

Triple = tuple[float, float, float]

TOOL_RADIUS = 0.012
"""Radius of the body of the tool [m]."""
NECK_LENGTH = 0.015
"""Length of the thin part at the end of the tool, which has the radius of the cup [m]."""


def build_bin(name: str, config: BinConfig) -> Bin:
    """Return a bin, with slots evenly distributed over its floor, for a section of a cell file."""
    position, size = np.array(config.position), np.array(config.size)
    columns, rows = config.slots
    x = position[0] + size[0] * ((np.arange(columns) + 0.5) / columns - 0.5)
    y = position[1] + size[1] * ((np.arange(rows) + 0.5) / rows - 0.5)
    slots = np.array([[column, row] for column in x for row in y])
    return Bin(name, position, size, slots)


def build_object_class(label: str, config: ObjectConfig) -> ObjectClass:
    """Return an object class, with the default mass, for a section of a cell file."""
    return ObjectClass(label, config.height, config.radius, config.ring)


def compute_travel_height(config: CellConfig) -> float:
    """Return the tool height [m] at which the tallest held object passes over all bin walls and piles."""
    max_height = max(kind.height for kind in config.objects.values())
    wall_top = max(bin.position[2] + bin.size[2] for bin in config.bins.values())
    return max(wall_top, compute_max_pile_height(config)) + max_height + config.motion.clearance


def compute_max_pile_height(config: CellConfig) -> float:
    """Return the maximum height of a pile on the table [m]: the tallest object, or two if stacks occur."""
    max_height = max(kind.height for kind in config.objects.values())
    return 2 * max_height if config.table.stacked else max_height


def list_bin_walls(size: tuple[float, float, float]) -> Sequence[tuple[Triple, Triple]]:
    """Return half extents and centre, relative to the bin, of the boxes of its floor and four walls [m]."""
    (length, width, height), t = size, BIN_THICKNESS
    across, along = (t / 2, width / 2 + t, height / 2), (length / 2, t / 2, height / 2)
    x, y, z = (length + t) / 2, (width + t) / 2, height / 2
    floor = (length / 2 + t, width / 2 + t, t / 2), (0.0, 0.0, t / 2)
    sides = (across, (x, 0.0, z)), (across, (-x, 0.0, z)), (along, (0.0, y, z)), (along, (0.0, -y, z))
    return floor, *sides


def find_unreachable_places(
    config: CellConfig, require_reachable: Callable[[Array, float], None]
) -> Iterator[tuple[KeyPath, str]]:
    """Yield the key in the cell file and a message for each bin or safe place that the arm cannot reach.

    Args:
        config: The cell file.
        require_reachable: Raises `Unreachable` if the arm cannot reach a position `(2,)` [m] over a floor of
            the given height [m].
    """
    places: list[tuple[KeyPath, str, Array, float]] = [
        (("bins", name, "position"), f'the bin "{name}"', build_bin(name, bin).slots, bin.position[2])
        for name, bin in config.bins.items()
    ]
    safe_place = np.array([config.safe_place[:2]])
    places.append((("safe_place",), "the safe place", safe_place, config.safe_place[2]))
    for keys, name, slots, floor_height in places:
        try:
            for slot in slots:
                require_reachable(slot, floor_height)
        except Unreachable as error:
            yield keys, f"{name} is out of reach: {error}"


def build_bins(config: CellConfig) -> dict[str, Bin]:
    """Return the bins of a cell file by name."""
    return {name: build_bin(name, bin) for name, bin in config.bins.items()}


def build_object_classes(config: CellConfig) -> dict[str, ObjectClass]:
    """Return the object classes of a cell file by label, each with the default mass."""
    return {label: build_object_class(label, kind) for label, kind in config.objects.items()}
