"""Rows of objects that touch or almost touch: objects that fingers place, and what a run says about others.

The order and the yaws of the objects and the place of the row follow from the seed and the gap.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from executive.campaign.jobs import MissionUnderTest
from executive.drivers.sim.world import World
from executive.errors import InputError
from executive.geometry import Array, Pose, rotate_about_z
from executive.physics.cell_world import DISTANCE
from executive.processes import WorkerPool
from executive.record.recorded_run import RecordOptions, record_run
from executive.run.assembly import RunOptions
from tests.benchmarks.ground_truth import AuditedCell, FoundObject, Report, read_reports
from tests.benchmarks.report import Figures, describe, run_command, show_progress

GAPS = (0.0, 0.002, 0.004, 0.008)
"""Distances between the shapes of neighbours [m]."""
MAX_GAP_ERROR = 1e-4
"""Maximum error of a gap [m]."""
START_DISTANCE = 0.2
"""Distance between the centres of neighbours before they are moved together [m]."""
MAX_PLACE_ATTEMPTS = 200
"""Maximum number of places and directions that are tried for a row."""
PLACED = "placed"
ENDS = (PLACED, "neighbour named", "reported", "silent", "wrong bin", "off the table")
"""Ends of an object; `reported`: the run is no success, but does not say which neighbour was in the way."""
PROBLEMS = ENDS[3:]
"""Ends of an object that are problems."""


class RowCell(AuditedCell):
    """An audited cell whose objects form a row with a gap [m] between their shapes."""

    def __init__(self, *arguments: Any, gap: float, **options: Any) -> None:
        super().__init__(*arguments, **options)
        arrange_row(self.driver.world, gap, np.random.default_rng([options["seed"], round(gap * 1e6)]))


def arrange_row(world: World, gap: float, rng: np.random.Generator) -> None:
    """Move all objects into a row at a random place in the workspace.

    Raises:
        InputError: The workspace has no room for the row.
    """
    table = world.config.table
    low = np.array([table.x[0], table.y[0]])
    high = np.array([table.x[1], table.y[1]])
    bodies = list(map(int, rng.permutation(sorted(world.labels))))
    for _ in range(MAX_PLACE_ATTEMPTS):
        angle = rng.uniform(0, math.tau)
        direction = np.array([math.cos(angle), math.sin(angle), 0.0])
        positions = place_row(world, bodies, rng.uniform(low, high), direction, gap, rng)
        if np.all((low <= positions) & (positions <= high)):
            world.settle(bodies)
            world.rest_positions = {body: [world.get_object_pose(body).position] for body in bodies}
            return
    raise InputError(f"the cell {world.config.cell} has no room for a row of {len(bodies)} objects")


def place_row(
    world: World, bodies: Sequence[int], start: Array, direction: Array, gap: float, rng: np.random.Generator
) -> Array:
    """Place bodies from `start` `(2,)` [m] along a unit vector, and return their positions `(N, 2)` [m]."""
    previous_body = None
    position = np.append(start, 0.0)
    positions = []
    for body in bodies:
        rotation = rotate_about_z(rng.uniform(0, math.tau))
        if previous_body is not None:
            position = position + START_DISTANCE * direction
        position[2] = world.get_object_pose(body).position[2]
        world.place_object(body, Pose(rotation, position))
        # Each step is at most the distance that is left, so that the bodies never overlap.
        while previous_body is not None:
            distance = measure_distance(world, body, previous_body) - gap
            if distance <= MAX_GAP_ERROR:
                break
            position = position - distance * direction
            world.place_object(body, Pose(rotation, position))
        positions.append(position[:2])
        previous_body = body
    return np.array(positions)


def measure_distance(world: World, body: int, other_body: int) -> float:
    """Return the distance between the shapes of two bodies [m]."""
    points = world.client.getClosestPoints(body, other_body, START_DISTANCE)
    return min(float(point[DISTANCE]) for point in points)


def measure(
    subject: MissionUnderTest,
    runs_folder: Path,
    workers: int,
    rows: int = 20,
    objects: int = 6,
    gap_mm: float | None = None,
) -> Figures:
    """Run MISSION with `--rows` rows of `--objects` objects for each gap, or only for `--gap-mm`.

    A problem is an object in a wrong bin, off the table, or left although the run is a success.
    """
    gaps = GAPS if gap_mm is None else (gap_mm / 1000,)
    jobs = list(product(gaps, range(subject.seed, subject.seed + rows)))
    with WorkerPool(workers) as pool:
        run = partial(run_row, subject, runs_folder, objects)
        futures = [pool.submit(run, gap, seed) for gap, seed in jobs]
        ends = [future.result() for future in show_progress(futures, "runs")]
    counts = {gap: Counter[str]() for gap in gaps}
    for (gap, _), ends_of_run in zip(jobs, ends, strict=True):
        counts[gap].update(ends_of_run)
    return {
        **describe(subject),
        "gaps": [
            {"gap mm": 1000 * gap, "objects": count.total(), **{end: count[end] for end in ENDS}}
            for gap, count in counts.items()
        ],
        "problems": [
            f"{count[end]} objects at a gap of {1000 * gap:g} mm: {end}"
            for gap, count in counts.items()
            for end in PROBLEMS
            if count[end]
        ],
    }


def run_row(subject: MissionUnderTest, runs: Path, objects: int, gap: float, seed: int) -> list[str]:
    """Record a run with a row, and return the end of each of its objects."""
    cells: list[RowCell] = []
    # The keywords of a factory are those of a cell with true detections.
    keywords = getattr(subject.make_cell, "keywords", {})

    def make_cell(config: Any, **options: Any) -> RowCell:
        table = config.table.model_copy(update={"objects": (objects, objects)})
        config = config.model_copy(update={"table": table})
        cells.append(RowCell(config, **options, **keywords, gap=gap))
        return cells[0]

    options = RunOptions(seed, subject.requests, make_cell=make_cell)
    result = record_run(subject.loaded, options, runs, RecordOptions(saves_pictures=False))
    reports = read_reports(Path(result.run))
    return [classify(found, reports, result.status) for found in cells[0].objects]


def classify(found: FoundObject, reports: Mapping[str, Report], status: str) -> str:
    """Return the end of an object, one of `ENDS`, in a run with the given reports and status."""
    if found.is_in_wrong_bin:
        return "wrong bin"
    if found.true_place == "floor":
        return "off the table"
    if found.place == "right":
        return PLACED
    if any("is in the way" in reports[item].reason for item in found.items if item in reports):
        return "neighbour named"
    return "silent" if status == "SUCCESS" else "reported"


if __name__ == "__main__":
    run_command(measure)
