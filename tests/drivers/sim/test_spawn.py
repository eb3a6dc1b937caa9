"""The world that a run begins with: objects at rest, apart, and on top of others if asked for."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executive.cell.config import CellConfig
from executive.cell.devices import derive_seeds
from executive.drivers.sim.spawn import spawn_objects
from executive.drivers.sim.world import World
from executive.errors import InputError

Build = Callable[[CellConfig], World]


def with_stacks(config: CellConfig, share: float, count: int) -> CellConfig:
    """Return the cell with a share of stacked objects, and this number of objects."""
    changes = {"stacked": share, "objects": (count, count)}
    return config.model_copy(update={"table": config.table.model_copy(update=changes)})


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


def test_too_many_objects_are_refused_with_what_to_change(build: Build, overhead: CellConfig) -> None:
    with pytest.raises(InputError, match=r"100 objects found no room .* ask for fewer or widen table\.x"):
        spawn_objects(build(with_stacks(overhead, 0.0, 100)), 1)


def test_the_parts_draw_from_seeds_of_their_own() -> None:
    assert derive_seeds(5)[:3] == (803261128, 3767054407, 3210010690)
