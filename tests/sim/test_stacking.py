"""Objects on top of others: as many as asked for where they stay, and none where nothing asks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from executive.cell_config import CellConfig
from executive.layout import travel_height
from executive.sim.least_times import SimLeastTimes
from executive.sim.models import load_mesh
from executive.sim.spawn import spawn
from executive.sim.world import World

Build = Callable[[CellConfig], World]


def with_stacks(config: CellConfig, share: float) -> CellConfig:
    return config.model_copy(update={"table": config.table.model_copy(update={"stacked": share})})


def carried(world: World) -> dict[int, int]:
    """Return what each object that lies on another one lies on."""
    places = {body: world.object_pose(body).position[:2] for body in world.bodies}
    return {
        upper: next(
            lower
            for lower, place in places.items()
            if lower != upper and np.linalg.norm(place - places[upper]) < 0.03
        )
        for upper in world.bodies
        if lowest(world, upper) > 0.02
    }


def lowest(world: World, body: int) -> float:
    """Return the height of an object's underside [m]."""
    vertices = load_mesh(world.config.objects[world.bodies[body]]).vertices
    return float(world.object_pose(body).apply(vertices)[:, 2].min())


@pytest.mark.parametrize("seed", range(3))
def test_what_lies_on_another_object_stays_there(build: Build, overhead: CellConfig, seed: int) -> None:
    world = build(with_stacks(overhead, 1.0))
    spawn(world, world.config, seed, count=6)
    pairs = carried(world)
    assert pairs
    before = {body: world.object_pose(body).position for body in world.bodies}
    for _ in range(240):
        world.step()
    assert carried(world) == pairs
    for upper in pairs:
        assert world.object_pose(upper).position == pytest.approx(before[upper], abs=1e-3)
        assert lowest(world, upper) == pytest.approx(0.05, abs=2e-3)


def test_cubes_carry_one_object_each_and_balls_nothing(build: Build, overhead: CellConfig) -> None:
    classes = set()
    for seed in range(4):
        world = build(with_stacks(overhead, 1.0))
        spawn(world, world.config, seed, count=6)
        pairs = carried(world)
        assert len({*pairs, *pairs.values()}) == 2 * len(pairs)
        classes |= {(world.bodies[upper], world.bodies[lower]) for upper, lower in pairs.items()}
        others = world.bodies.keys() - pairs.keys()
        assert all(abs(lowest(world, body)) < 2e-3 for body in others)
    assert classes == {("cube", "cube"), ("duck", "cube")}


def test_the_share_decides_how_many(build: Build, overhead: CellConfig) -> None:
    counts = {}
    only_cubes = overhead.model_copy(update={"objects": {"cube": overhead.objects["cube"]}})
    for share in (0.0, 0.3, 1.0):
        world = build(with_stacks(only_cubes, share))
        spawn(world, world.config, 2, count=10)
        counts[share] = len(carried(world))
    assert counts[0.0] == 0 < counts[0.3] < counts[1.0] == 5


def test_the_seed_decides_it_all(build: Build, overhead: CellConfig) -> None:
    places = []
    for seed in (5, 5, 6):
        world = build(with_stacks(overhead, 0.7))
        places.append(
            [world.object_pose(body).rounded() for body in spawn(world, world.config, seed, count=5)]
        )
    assert places[0] == places[1] != places[2]


def test_without_stacks_a_seed_gives_what_it_always_gave(build: Build, overhead: CellConfig) -> None:
    world = build(overhead)
    places = [
        (world.bodies[body], *world.object_pose(body).rounded(4)[:2]) for body in spawn(world, overhead, 1)
    ]
    assert places == [
        ("sphere", 0.6287, -0.0828),
        ("duck", 0.5131, 0.1442),
        ("duck", 0.51, 0.0218),
        ("cube", 0.4261, 0.1115),
    ]


def test_a_load_travels_over_stacks_and_starts_from_their_tops(overhead: CellConfig) -> None:
    stacks = with_stacks(overhead, 0.3)
    tallest = max(kind.height for kind in overhead.objects.values())
    over_stack = travel_height(stacks) - tallest - overhead.motion.clearance
    assert over_stack == pytest.approx(2 * tallest)
    guarded = {"motion": overhead.motion.model_copy(update={"descent": 0.1})}
    one, two = (SimLeastTimes(config.model_copy(update=guarded)).descent for config in (overhead, stacks))
    assert one - two == pytest.approx(tallest / overhead.motion.descent_speed)
