"""The seal map: how cups of several sizes would seal on each class of objects, off-centre by how much.

The constants of a cell file's `tool:` block are justified by this table, measured on the very shapes
that the simulation collides with. The shipped one, `seal_map.csv`, was written by
`executive bench seal`.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

from executive.cell_config import CellConfig, ToolConfig
from executive.geometry import Array, Pose, about_z, tool_down
from executive.sim.models import load_mesh
from executive.sim.seal import breakaway, measure
from executive.sim.world import World

SHIPPED = Path(__file__).with_name("seal_map.csv")
"""The map that ships with the package."""
CUP_RADII = (0.004, 0.005, 0.006, 0.008, 0.010, 0.012)
"""Lip radii measured [m]."""
OFFSETS = (0.0, 0.002, 0.004, 0.006, 0.008, 0.010, 0.012)
"""Distances of the cup's axis from the middle of the object's outline [m]."""
DIRECTIONS = 8
"""Directions of every offset."""
YAWS = 12
"""Yaws of every object: the outline's box, at which a detection aims, turns with it."""
SETTLE = 120
"""Physics steps an object gets to come to rest."""


@dataclass(frozen=True)
class Row:
    """All placements of one cup at one offset on one class of objects.

    Attributes:
        label: Class of objects.
        cup_radius: Radius of the lip [m].
        offset: Distance from the middle of the outline's box, seen from above [m].
        placements: Number of placements: directions times yaws.
        gap_p10, gap_median, gap_p90: Quantiles of the rim gap [m]; infinite off the object.
        tilt_p10, tilt_median, tilt_p90: Quantiles of the tilt [rad].
        sealed: Share of placements whose breakaway force reaches the tool's `least_force`.
        force_p10, force_median, force_p90: Quantiles of the breakaway force [N].
    """

    label: str
    cup_radius: float
    offset: float
    placements: int
    gap_p10: float
    gap_median: float
    gap_p90: float
    tilt_p10: float
    tilt_median: float
    tilt_p90: float
    sealed: float
    force_p10: float
    force_median: float
    force_p90: float


def measure_map(
    config: CellConfig, cup_radii: Sequence[float] = CUP_RADII, offsets: Sequence[float] = OFFSETS
) -> list[Row]:
    """Return a row per object class, cup radius and offset, for the cell's tool.

    Cups of other sizes than the tool's are given its vacuum (force over lip area) and tolerances.
    """
    rows = []
    world = World(config)
    try:
        for label in config.objects:
            places = {offset: list(_places(config, label, offset)) for offset in offsets}
            body = world.add_object(label, _spawn(config, label), (1.0, 1.0, 1.0))
            for _ in range(SETTLE):
                world.step()
            for radius in cup_radii:
                tool = _resized(config.tool, radius)
                rows += [_row(world, body, tool, offset, places[offset]) for offset in offsets]
            world.remove_object(body)
    finally:
        world.close()
    return rows


def write_map(rows: Iterable[Row], path: Path) -> None:
    """Write the rows as CSV with a header, in SI units."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Row)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def read_map(path: Path = SHIPPED) -> list[Row]:
    """Return the rows of a file that `write_map` wrote."""
    types = {"label": str, "placements": int}
    with path.open(newline="") as file:
        return [
            Row(**{name: types.get(name, float)(text) for name, text in line.items()})
            for line in csv.DictReader(file)
        ]


def _spawn(config: CellConfig, label: str) -> Pose:
    """Return `X_WO` of an object standing in the middle of the table."""
    x, y = (sum(side) / 2 for side in (config.table.x, config.table.y))
    return Pose(np.eye(3), np.array([x, y, -load_mesh(config.objects[label]).bottom]))


def _places(config: CellConfig, label: str, offset: float) -> Iterable[Array]:
    """Yield cup positions `(2,)` [m] in the object's frame: turning the object is turning the aim.

    What has a ring to be touched on is aimed at there, in the direction of the offset.
    """
    outline = load_mesh(config.objects[label]).vertices[:, :2]
    reach = config.objects[label].ring + offset
    for yaw in 2 * np.pi * np.arange(YAWS) / YAWS:
        R_WO = about_z(yaw)[:2, :2]
        turned = outline @ R_WO.T
        aim_W = (turned.min(axis=0) + turned.max(axis=0)) / 2
        for angle in 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS:
            yield R_WO.T @ (aim_W + reach * np.array([math.cos(angle), math.sin(angle)]))


def _resized(tool: ToolConfig, cup_radius: float) -> ToolConfig:
    """Return the tool with another lip, at the same vacuum."""
    force = tool.force * (cup_radius / tool.cup_radius) ** 2
    return tool.model_copy(update={"cup_radius": cup_radius, "force": force})


def _row(world: World, body: int, tool: ToolConfig, offset: float, places: Sequence[Array]) -> Row:
    X_WO = world.object_pose(body)
    top = world.client.getAABB(body)[1][2] + tool.reach
    gaps, tilts, forces = [], [], []
    for place in places:
        x, y, _ = X_WO.apply([*place, 0.0])
        # Twice: Bullet's ray against a sphere errs by up to 0.8 mm over 0.2 m, by 0.02 mm over 5 mm.
        seal = measure(world.client, tool_down([x, y, top]), {body}, tool.cup_radius, top)
        if seal is not None:
            landed = tool_down([x, y, top - seal.distance])
            seal = measure(world.client, landed, {body}, tool.cup_radius, tool.reach)
        gaps.append(math.inf if seal is None else seal.gap)
        tilts.append(math.pi / 2 if seal is None else seal.tilt)
        forces.append(breakaway(seal, tool))
    return Row(
        world.bodies[body],
        tool.cup_radius,
        offset,
        len(places),
        *_quantiles(gaps, 6),
        *_quantiles(tilts, 4),
        round(float(np.mean(np.array(forces) >= tool.least_force)), 4),
        *_quantiles(forces, 3),
    )


def _quantiles(values: Sequence[float], digits: int) -> tuple[float, float, float]:
    """Return the 10 %, 50 % and 90 % quantiles that are themselves values: infinity cannot be averaged."""
    low, median, high = np.quantile(values, [0.1, 0.5, 0.9], method="lower")
    return round(float(low), digits), round(float(median), digits), round(float(high), digits)
