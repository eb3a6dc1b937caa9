"""Stops at any time and at a touch: short, on the path, and gentle enough for arm and cup."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from rig import Rig

from executive.cell.arm import Goal, Task
from executive.cell.config import CellConfig
from executive.cell.device_config import STEP
from executive.motion.trajectory import Trajectory
from tests.benchmarks.halts import measure_distance

PICK = Goal((0.6, -0.15, 0.04), guarded_length=0.016, guarded_speed=0.035)
ON_A_CUBE = Goal((0.6, -0.15, 0.0505))
IN_A_BIN = Goal((0.3, 0.55, 0.07))
SHARES = np.random.default_rng(11).uniform(0.02, 0.98, 3)


@pytest.fixture(scope="module")
def empty(overhead: CellConfig) -> Iterator[Rig]:
    """A rig for one stop after another: after each the arm is put back home."""
    rig = Rig(overhead)
    yield rig
    rig.close()


def stopped(rig: Rig, motion: Trajectory, share: float) -> int:
    """Stop a motion after a share of its time; return how many steps it took to rest."""
    rig.arm.start(motion)
    rig.step(round(share * motion.duration / STEP))
    rig.arm.stop()
    return rig.run()


@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize("way", ["approach", "transit"])
def test_a_stop_is_short_stays_on_the_path_and_keeps_the_stop_limits(
    empty: Rig, overhead: CellConfig, way: str, share: float
) -> None:
    rig, limits = empty, empty.planner.limits
    rig.go("home")
    if way == "approach":
        motion = rig.planned(PICK)
    else:
        rig.go(ON_A_CUBE)
        motion = rig.planned(IN_A_BIN, Task(overhead.objects["cube"].build_class("cube"), 7.0))
    steps = stopped(rig, motion, share)
    assert steps <= 120
    assert measure_distance(rig.device.commanded_q, motion) < 1e-9
    assert np.max(np.abs(rig.device.q - rig.device.commanded_q)) < 1e-4
    rig.step(4)
    braking = np.array(rig.commands)[-(steps + 9) :]
    accelerations = np.diff(braking, 2, axis=0) / STEP**2
    jerks = np.diff(accelerations, axis=0) / STEP
    assert np.max(np.abs(accelerations) / limits.stop_acceleration) <= 1.0
    # A difference over a step sees a little more than the profile's own constant jerk.
    assert np.max(np.abs(jerks) / limits.stop_jerk) <= 1.02
    rig.go("home")  # the next motion begins where it stopped


@pytest.mark.parametrize(
    ("label", "place", "share"),
    [("cube", (0.45, 0.2), -1.0), ("sphere", (0.62, -0.2), 0.0), ("cube", (0.62, -0.2), 0.8)],
    ids=["lower", "as expected", "higher"],
)
def test_a_guarded_descent_rests_within_a_millimetre_of_where_it_felt_something(
    rig: Rig, label: str, place: tuple[float, float], share: float
) -> None:
    """The surface is where it was expected, or off by a share of the guarded part above it."""
    motion, top = rig.config.motion, rig.config.objects[label].height
    body = rig.add(label, *place)
    rig.step(60)
    lay, expected = rig.world.get_object_pose(body).position, top - share * motion.descent
    lowest = expected - 0.015
    goal = Goal((*place, lowest), guarded_length=0.015 + motion.descent, guarded_speed=motion.descent_speed)
    felt, pressed = rig.touch_down(goal)
    assert felt[2] == pytest.approx(top, abs=0.0012)
    assert np.linalg.norm(rig.arm.tool_pose.position - felt) < 0.001
    assert rig.tool.touching
    assert rig.arm.collision is None
    assert pressed < 1.0, "the weight of the object [N]"
    assert rig.world.get_object_pose(body).position == pytest.approx(lay, abs=2e-4)
    rig.tool.close()
    assert rig.tool.holding
