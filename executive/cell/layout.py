"""Bins, object classes, travel and pile heights, and bin boxes of a cell file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from executive.cell.config import BinConfig, CellConfig, ObjectConfig
from executive.cell.objects import BIN_THICKNESS, Bin, ObjectClass

Vector3 = tuple[float, float, float]
"""Three values along x, y and z [m]."""
TOOL_RADIUS = 0.012
"""Radius of the body of the tool [m]."""
NECK_LENGTH = 0.015
"""Length of the thin end of the tool [m]; the thin end has the radius of the cup."""


def build_bin(name: str, config: BinConfig) -> Bin:
    """Return the bin that `config` declares, with slots evenly distributed over the floor."""
    position, size = np.array(config.position), np.array(config.size)
    slot_indices = np.array([*np.ndindex(config.slots)])
    slots = position[:2] + size[:2] * ((slot_indices + 0.5) / config.slots - 0.5)
    return Bin(name, position, size, slots)


def build_object_class(label: str, config: ObjectConfig) -> ObjectClass:
    """Return the object class that `config` declares; if it declares no mass, with the default mass."""
    object_class = ObjectClass(label, config.height, config.radius, config.ring, looks_like=config.looks_like)
    if config.mass is None:
        return object_class
    return replace(object_class, mass=config.mass, mass_std=config.mass_std)


def compute_travel_height(config: CellConfig) -> float:
    """Return the tool height [m] at which a held object of any class clears all bin walls and piles."""
    wall_top = max(bin.position[2] + bin.size[2] for bin in config.bins.values())
    max_obstacle_top = max(wall_top, compute_max_pile_height(config))
    return max_obstacle_top + config.max_object_height + config.motion.clearance


def compute_max_pile_height(config: CellConfig) -> float:
    """Return the maximum height of a pile on the table [m]: two objects if `stacked` is above 0, else one."""
    return (2 if config.table.stacked else 1) * config.max_object_height


def list_bin_boxes(size: Vector3) -> Sequence[tuple[Vector3, Vector3]]:
    """Return half extents and centre of each box of a bin: the floor and the four walls [m].

    `size` is `Bin.size`: length, width and height [m]. Centres are relative to `Bin.position`.
    """
    (length, width, height), thickness = size, BIN_THICKNESS
    wall_x, wall_y, wall_z = (length + thickness) / 2, (width + thickness) / 2, height / 2
    floor = (length / 2 + thickness, width / 2 + thickness, thickness / 2), (0.0, 0.0, thickness / 2)
    end_size, side_size = (thickness / 2, width / 2 + thickness, wall_z), (length / 2, thickness / 2, wall_z)
    end_walls = [(end_size, (x, 0.0, wall_z)) for x in (wall_x, -wall_x)]
    side_walls = [(side_size, (0.0, y, wall_z)) for y in (wall_y, -wall_y)]
    return floor, *end_walls, *side_walls


def build_bins(config: CellConfig) -> dict[str, Bin]:
    """Return the bins of a cell file by name."""
    return {name: build_bin(name, bin) for name, bin in config.bins.items()}


def build_object_classes(config: CellConfig) -> dict[str, ObjectClass]:
    """Return the object classes of a cell file by label; the masses in URDFs are not read."""
    return {label: build_object_class(label, section) for label, section in config.objects.items()}
