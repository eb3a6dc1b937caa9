"""Bounds of what things take: below everything that the arm can do, yet of use."""

from __future__ import annotations

import numpy as np
import pytest

from executive.cell.arm import Goal, Task
from executive.cell.config import CellConfig
from executive.cell.layout import as_bin, object_class
from executive.cell.objects import Load
from executive.cells.sim.cell import SimCell
from executive.cells.sim.collision import PathClearance
from executive.cells.sim.least_times import SimLeastTimes
from executive.geometry import Array
from executive.motion.arms import build_planner


@pytest.fixture(scope="module")
def least(overhead: CellConfig) -> SimLeastTimes:
    return SimLeastTimes(overhead)


def changed(config: CellConfig, section: str, **values: object) -> CellConfig:
    """Return the cell with other values in one of its sections."""
    return config.model_copy(update={section: getattr(config, section).model_copy(update=values)})


def nearest(config: CellConfig, slots: Array) -> Array:
    """Return the places `(N, 2)` [m] of the workspace nearest to slots `(N, 2)` [m]."""
    low, high = np.transpose([config.table.x, config.table.y])
    return np.clip(slots, low, high)


@pytest.mark.slow
def test_no_planned_carry_is_faster_than_the_least(overhead: CellConfig, least: SimLeastTimes) -> None:
    """Half of them are the shortest there are: from the place nearest to a slot, and higher than it must."""
    clearance = PathClearance(overhead)
    planner = build_planner(overhead, clearance.check)
    rng, home = np.random.default_rng(3), np.radians(overhead.arm.poses_deg["home"])
    shares = []
    for number in range(24):
        bin = list(overhead.bins)[number % 3]
        label = list(overhead.objects)[number // 3 % 3]
        kind = object_class(label, overhead.objects[label])
        slot = rng.permutation(as_bin(bin, overhead.bins[bin]).slots)[0]
        x, y = rng.uniform(*np.transpose([overhead.table.x, overhead.table.y]))
        drop = 0.015
        if number % 2:
            (x, y), drop = nearest(overhead, slot), 0.1
        over = Goal((*slot, kind.height + drop))
        start = planner.plan(home, Goal((x, y, kind.height))).end
        shares.append(least.carry(bin) / planner.plan(start, over, Task(Load(kind))).duration)
    clearance.close()
    assert max(shares) < 0.9
    assert np.mean(shares) > 0.4, "else it is of little use"


def test_the_bins_differ_and_no_bin_means_the_nearest(overhead, least) -> None:
    times = {bin: least.carry(bin) for bin in overhead.bins}
    assert times == pytest.approx(
        {"red_bin": 0.34913, "blue_bin": 0.379096, "yellow_bin": 0.328779}, rel=1e-5
    )
    assert least.carry(None) == min(times.values())
    assert least.carry("grey_bin") == 0.0
    assert SimLeastTimes(changed(overhead, "table", x=(1.2, 1.4))).carry("red_bin") == 0.0, "out of reach"


def test_a_descent_may_end_early_on_an_object_higher_than_expected(overhead: CellConfig) -> None:
    """The objects differ by 10 mm in height, and the lip feels a surface 1 mm away."""
    long = SimLeastTimes(changed(overhead, "motion", descent=0.02, descent_speed=0.03))
    assert long.descent == pytest.approx((0.020 - 0.010 - 0.001) / 0.03)
    assert SimLeastTimes(changed(overhead, "motion", descent=0.008)).descent == 0.0
    cubes = overhead.model_copy(update={"objects": {"cube": overhead.objects["cube"]}})
    motion = overhead.motion
    assert SimLeastTimes(cubes).descent == pytest.approx((motion.descent - 0.001) / motion.descent_speed)


def test_a_detector_answers_after_its_latency(overhead) -> None:
    slow = overhead.detectors["embedded"].model_copy(update={"latency": 0.7})
    least = SimCell.least_times(
        overhead.model_copy(update={"detectors": {**overhead.detectors, "slow": slow}})
    )
    assert [least.answer(name) for name in ("", "embedded", "slow", "none")] == [0.05, 0.05, 0.7, 0.0]
