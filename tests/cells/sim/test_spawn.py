"""The world that a run begins with: objects at rest, apart, and on top of others if asked for."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest

from executive.cell.config import CellConfig
from executive.cells.sim.models import load_mesh
from executive.cells.sim.spawn import derive_seeds, spawn_objects
from executive.cells.sim.world import World
from executive.errors import InputError

Build = Callable[[CellConfig], World]


def with_stacks(config: CellConfig, share: float, count: int | None = None) -> CellConfig:
    """Return the cell with a share of stacked objects and, if a count is given, this number of objects."""
    changes = {"stacked": share} if count is None else {"stacked": share, "objects": (count, count)}
    return config.model_copy(update={"table": config.table.model_copy(update=changes)})


def lowest(world: World, body: int) -> float:
    """Return the height of an object's underside [m]."""
    vertices = load_mesh(world.config.objects[world.labels[body]]).vertices
    return float(world.get_object_pose(body).apply(vertices)[:, 2].min())


def carried(world: World) -> dict[int, int]:
    """Return what each object that lies on another one lies on."""
    places = {body: world.get_object_pose(body).position[:2] for body in world.labels}
    return {
        upper: min(places.keys() - {upper}, key=lambda b: float(np.linalg.norm(places[b] - places[upper])))
        for upper in world.labels
        if lowest(world, upper) > 0.02
    }


def placed(world: World) -> list[tuple[str, float, float, float]]:
    """Return label and rounded place [m] of every object."""
    return [
        (label, *(round(float(value), 4) for value in world.get_object_pose(body).position))
        for body, label in world.labels.items()
    ]


def test_a_seed_decides_everything(build: Build, overhead: CellConfig) -> None:
    plain, stacked = build(overhead), build(with_stacks(overhead, 1.0, 4))
    assert spawn_objects(plain, 1) == tuple(plain.labels)
    for body, label in plain.labels.items():
        colour = plain.client.getVisualShapeData(body)[0][7][:3]
        assert tuple(round(value, 3) for value in colour) in overhead.objects[label].colours
    spawn_objects(stacked, 2)
    assert placed(plain) == [
        ("sphere", 0.6287, -0.0828, 0.03), ("duck", 0.5131, 0.1442, -0.0023), ("duck", 0.51, 0.0218, -0.0023),
        ("cube", 0.4261, 0.1115, 0.025),
    ]  # fmt: skip
    assert placed(stacked) == [
        ("duck", 0.4613, -0.1923, 0.0477), ("cube", 0.4529, -0.028, 0.075), ("cube", 0.4613, -0.1957, 0.025),
        ("cube", 0.453, -0.0296, 0.025),
    ]  # fmt: skip


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_objects_stand_still_apart_and_inside_the_workspace(
    build: Build, overhead: CellConfig, share: float
) -> None:
    world, table = build(with_stacks(overhead, share, 6 if share else None)), overhead.table
    bodies = spawn_objects(world, 0)
    assert table.objects[0] <= len(bodies) <= table.objects[1]
    poses, pairs = {body: world.get_object_pose(body) for body in bodies}, carried(world)
    assert bool(pairs) is bool(share)
    assert len({*pairs, *pairs.values()}) == 2 * len(pairs), "each carries one object and lies on the table"
    for pose in poses.values():
        assert table.x[0] - 0.005 <= pose.position[0] <= table.x[1] + 0.005
        assert table.y[0] - 0.005 <= pose.position[1] <= table.y[1] + 0.005
    for (a, X_WA), (b, X_WB) in combinations(poses.items(), 2):
        radii = sum(overhead.objects[world.labels[body]].radius for body in (a, b))
        distance = float(np.linalg.norm(X_WA.position[:2] - X_WB.position[:2]))
        assert {a, b} & pairs.keys() or distance >= radii + table.gap - 0.005
    for _ in range(240):
        world.step()
    assert carried(world) == pairs
    for body, before in poses.items():
        assert world.get_object_pose(body).position == pytest.approx(before.position, abs=1e-3)
        assert lowest(world, body) == pytest.approx(0.05 if body in pairs else 0.0, abs=2e-3)


def test_too_many_objects_are_refused_with_what_to_change(build: Build, overhead: CellConfig) -> None:
    with pytest.raises(InputError, match=r"100 objects found no room .* ask for fewer or widen table\.x"):
        spawn_objects(build(with_stacks(overhead, 0.0, 100)), 1)


def test_the_parts_draw_from_seeds_of_their_own() -> None:
    assert derive_seeds(5)[:3] == (803261128, 3767054407, 3210010690)
