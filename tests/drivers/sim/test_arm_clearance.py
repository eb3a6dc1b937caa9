from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from executive.arms.iiwa14 import Iiwa14, interpolate_max_joint_6_angle
from executive.cell.arm import Task
from executive.cell.config import CellConfig
from executive.cell.objects import ObjectClass, Obstacle
from executive.errors import Blocked
from executive.motion.joints import build_kinematics
from executive.physics.collision import ClearanceChecker
from tests.motion.joint_states import reach

DUCK = Task(ObjectClass("duck", 0.05, 0.04))
TOWER = Obstacle(0.5, 0.1, 0.03, 0.2, "cube-3")
COIN = Obstacle(0.5, 0.1, 0.03, 0.0005, "a coin")
DUCK_AND_TOWER = replace(DUCK, obstacles=(TOWER,))
DUCK_AND_COIN = replace(DUCK, obstacles=(COIN,))


@pytest.fixture(scope="module")
def clearance(overhead: CellConfig) -> Iterator[ClearanceChecker]:
    clearance = ClearanceChecker(overhead)
    yield clearance
    clearance.close()


@pytest.fixture(scope="module")
def kinematics(overhead: CellConfig) -> Iiwa14:
    return build_kinematics(overhead)


@pytest.fixture
def at(overhead: CellConfig, kinematics: Iiwa14):
    """Joint positions with the tool centre point at a place."""
    home = np.radians(overhead.arm.poses_deg["home"])
    return lambda x, y, z: reach(kinematics, (x, y, z), home)


NAMED = re.escape(
    "the motion would bring the tool 0.036 m into cube-3, with the tool at (0.500, 0.100, 0.150) m; "
    "the minimum clearance is 0.005 m"
)
RED_BIN = 0.24, -0.48, 0.15
"""Centre of a bin and the distance of its wall along y [m]."""


def straight(*heights: float) -> list[tuple[float, float, float]]:
    return [(0.5, 0.0, height) for height in heights]


def into_the_bin(height: float, *distances: float) -> list[tuple[float, float, float]]:
    """Places at so many distances from the wall of the red bin [m]."""
    x, y, half = RED_BIN
    return [(x, y - half - distance, height) for distance in distances]


@pytest.mark.parametrize(
    ("places", "task", "said"),
    [
        (straight(0.1, 0.003), Task(), r"the tool 0\.00\d m from the table, with the tool at \(0\.500"),
        (into_the_bin(0.04, -0.15, 0.0), Task(), r"the tool 0\.\d+ m into red_bin"),
        (into_the_bin(0.09, 0.08, 0.04, 0.0), DUCK, r"the held duck .* red_bin"),
        ([(*RED_BIN[:2], z) for z in (0.15, 0.057)], DUCK, ""),
        (straight(0.003, 0.004, 0.1), Task(), ""),
        ([(0.5, y, 0.23) for y in (-0.1, 0.1)], Task(obstacles=(TOWER,)), ""),
        ([(0.5, y, 0.15) for y in (0.0, 0.1)], Task(obstacles=(TOWER,)), NAMED),
        ([(0.5, y, 0.23) for y in (-0.1, 0.1)], DUCK_AND_TOWER, r"held duck 0\.020 m into cube-3"),
        ([(0.5, 0.1, z) for z in (0.1, 0.0505)], DUCK_AND_COIN, r"the held duck .* a coin"),
        ([(0.5, 0.1, z) for z in (0.202, 0.203, 0.25)], Task(obstacles=(TOWER,)), ""),
        ([(0.5, 0.1, z) for z in (0.202, 0.201)], Task(obstacles=(TOWER,)), r"the tool 0\.001 m from cube-3"),
    ],
)
def test_a_path_keeps_the_margin_but_a_load_may_lie_on_table_and_floor(
    clearance: ClearanceChecker, at, places, task: Task, said: str
) -> None:
    """A motion may leave a place that is too near to something, but not come nearer."""
    path = np.array([at(*place) for place in places])
    if said:
        with pytest.raises(Blocked, match=said):
            clearance.check(path, task)
    else:
        clearance.check(path, task)


def test_the_margin_is_kept_above_and_beside_what_stands_around(clearance: ClearanceChecker, at) -> None:
    def passes(*end: float) -> bool:
        try:
            clearance.check(np.array([at(0.5, -0.1, 0.25), at(*end)]), Task(obstacles=(TOWER,)))
        except Blocked as error:
            assert "the tool 0.004 m from cube-3" in str(error)
            return False
        return True

    assert [passes(0.5, 0.1, 0.2 + gap) for gap in (0.006, 0.004)] == [True, False]
    beside = TOWER.radius + 0.012
    assert [passes(0.5, 0.1 - beside - gap, 0.15) for gap in (0.006, 0.004)] == [True, False]


@pytest.mark.parametrize("distance", [-0.01, 0.0, 0.0035, 0.006, 0.012, 0.02])
def test_the_wrist_may_fold_as_far_as_links_5_and_7_stay_apart(clearance, distance) -> None:
    world, rng = clearance.world, np.random.default_rng(6)
    for side in (-1, 1):
        q = rng.uniform(-2, 2, 7)
        q[5] = side * interpolate_max_joint_6_angle(distance)
        world.set_joint_positions(q)
        points = world.client.getClosestPoints(world.arm, world.arm, 0.05, linkIndexA=4, linkIndexB=6)
        assert min(point[8] for point in points) == pytest.approx(distance, abs=5e-4)
