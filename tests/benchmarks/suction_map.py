"""Map of the suction of cups of several sizes on each class of objects, at several offsets.

The map justifies the constants in the `tool` section of a cell file. It is measured on the collision shapes
of the simulation. `suction_map.csv` is the map of the cell `overhead`.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np

from executive.cell.config import CellConfig
from executive.drivers.sim.models import load_mesh
from executive.drivers.sim.world import World
from executive.geometry import Array, Pose, make_tool_down_pose, rotate_about_z
from executive.tools.suction import Suction, compute_breakaway_force, measure_contact
from tests.benchmarks.report import Figures, run_command

SHIPPED_MAP = Path(__file__).with_name("suction_map.csv")
"""File with the map of the cell `overhead`."""
CUP_RADII = (0.004, 0.005, 0.006, 0.008, 0.010, 0.012)
"""Measured lip radii [m]."""
OFFSETS = (0.0, 0.002, 0.004, 0.006, 0.008, 0.010, 0.012)
"""Distances of the cup's axis from the middle of the object's outline [m]."""
DIRECTIONS = 8
"""Number of directions of every offset."""
YAWS = 12
"""Number of yaw angles of every object; the aim, the centre of its bounding box, depends on the yaw."""
SETTLE_STEPS = 120
"""Physics steps in which an object comes to rest."""


def measure(cell: CellConfig, out: Path | None = None) -> Figures:
    """Measure the suction of cups on the objects of CELL, and write all rows to `--out` as CSV."""
    rows = measure_map(cell)
    if out is not None:
        with out.open("w", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
    # JSON has no word for infinity.
    plain = [{key: None if value == math.inf else value for key, value in row.items()} for row in rows]
    return {"cell": cell.cell, "map": plain}


def measure_map(
    cell: CellConfig, cup_radii: Sequence[float] = CUP_RADII, offsets: Sequence[float] = OFFSETS
) -> list[Figures]:
    """Return a row for every object class, cup radius and offset.

    Cups of all sizes have the vacuum (force per lip area) and the tolerances of the cell's tool.
    """
    rows = []
    with closing(World(cell)) as world:
        for label in cell.objects:
            places = {offset: list(_find_places(cell, label, offset)) for offset in offsets}
            body = world.add_object(label, _pose_on_table(cell, label), (1.0, 1.0, 1.0))
            for _ in range(SETTLE_STEPS):
                world.step()
            for radius in cup_radii:
                force = cell.tool.force * (radius / cell.tool.cup_radius) ** 2
                tool = cell.tool.model_copy(update={"cup_radius": radius, "force": force})
                for offset in offsets:
                    key = {"label": label, "cup_radius": radius, "offset": offset}
                    rows.append({**key, **_measure_places(world, body, tool, places[offset])})
            world.remove_object(body)
    return rows


def read_map(path: Path = SHIPPED_MAP) -> list[Figures]:
    """Return the rows of a written map."""
    with path.open(newline="") as file:
        lines = list(csv.DictReader(file))
    return [{key: text if key == "label" else float(text) for key, text in line.items()} for line in lines]


def _pose_on_table(cell: CellConfig, label: str) -> Pose:
    """Return `X_WO` of an object standing in the middle of the table."""
    x, y = (sum(side) / 2 for side in (cell.table.x, cell.table.y))
    return Pose(np.eye(3), np.array([x, y, -load_mesh(cell.objects[label]).bottom]))


def _find_places(cell: CellConfig, label: str, offset: float) -> Iterator[Array]:
    """Yield cup positions `(2,)` [m] in the object's frame, for every yaw and direction.

    An object with a ring is touched on the ring, in the direction of the offset.
    """
    outline = load_mesh(cell.objects[label]).vertices[:, :2]
    reach = cell.objects[label].ring + offset
    for yaw in 2 * np.pi * np.arange(YAWS) / YAWS:
        R_WO = rotate_about_z(yaw)[:2, :2]
        turned = outline @ R_WO.T
        aim_W = (turned.min(axis=0) + turned.max(axis=0)) / 2
        for angle in 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS:
            yield R_WO.T @ (aim_W + reach * np.array([math.cos(angle), math.sin(angle)]))


def _measure_places(world: World, body: int, tool: Suction, places: Iterable[Array]) -> Figures:
    """Return quantiles of rim gap [m], tilt [rad] and breakaway force [N], and the share of good seals.

    The gap is infinite beside the object; a seal is good if it bears the tool's `min_force`.
    """
    X_WO = world.get_object_pose(body)
    top = world.client.getAABB(body)[1][2] + tool.reach
    gaps, tilts, forces = [], [], []
    for place in places:
        x, y, _ = X_WO.apply([*place, 0.0])
        # Twice: Bullet's ray against a sphere errs by up to 0.8 mm over 0.2 m, by 0.02 mm over 5 mm.
        seal = measure_contact(world.client, make_tool_down_pose([x, y, top]), {body}, tool.cup_radius, top)
        if seal is not None:
            landed = make_tool_down_pose([x, y, top - seal.distance])
            seal = measure_contact(world.client, landed, {body}, tool.cup_radius, tool.reach)
        gaps.append(math.inf if seal is None else seal.gap)
        tilts.append(math.pi / 2 if seal is None else seal.tilt)
        forces.append(compute_breakaway_force(seal, tool))
    sealed = round(float(np.mean(np.array(forces) >= tool.min_force)), 4)
    row = {"placements": len(gaps), **_quantiles("gap", gaps, 6), **_quantiles("tilt", tilts, 4)}
    return {**row, "sealed": sealed, **_quantiles("force", forces, 3)}


def _quantiles(name: str, values: Sequence[float], digits: int) -> Figures:
    """Return quantiles without interpolation, which fails next to infinite values."""
    quantiles = np.quantile(values, [0.1, 0.5, 0.9], method="lower").round(digits).tolist()
    return dict(zip((f"{name}_p10", f"{name}_median", f"{name}_p90"), quantiles, strict=True))


if __name__ == "__main__":
    run_command(measure)
