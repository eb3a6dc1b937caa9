"""Bounds of what things take: below everything that the arm can do, yet of use."""

from __future__ import annotations

import numpy as np
import pytest

from executive.cell.arm import Goal, Task
from executive.cell.config import CellConfig
from executive.cell.layout import build_bin, build_object_class
from executive.cell.objects import Load
from executive.cells.sim.cell import SimCell
from executive.cells.sim.collision import ClearanceChecker
from executive.cells.sim.min_times import SimMinTimes
from executive.geometry import Array
from executive.motion.arms import build_planner


@pytest.fixture(scope="module")
def least(overhead: CellConfig) -> SimMinTimes:
    return SimMinTimes(overhead)


def changed(config: CellConfig, section: str, **values: object) -> CellConfig:
    """Return the cell with other values in one of its sections."""
    return config.model_copy(update={section: getattr(config, section).model_copy(update=values)})


def nearest(config: CellConfig, slots: Array) -> Array:
    """Return the places `(N, 2)` [m] of the workspace nearest to slots `(N, 2)` [m]."""
    low, high = np.transpose([config.table.x, config.table.y])
    return np.clip(slots, low, high)


@pytest.mark.slow
def test_no_planned_carry_is_faster_than_the_least(overhead: CellConfig, least: SimMinTimes) -> None:
    """Half of them are the shortest there are: from the place nearest to a slot, and higher than it must."""
    clearance = ClearanceChecker(overhead)
    planner = build_planner(overhead, clearance.check)
    rng, home = np.random.default_rng(3), np.radians(overhead.arm.poses_deg["home"])
    shares = []
    for number in range(24):
        bin = list(overhead.bins)[number % 3]
        label = list(overhead.objects)[number // 3 % 3]
        kind = build_object_class(label, overhead.objects[label])
        slot = rng.permutation(build_bin(bin, overhead.bins[bin]).slots)[0]
        x, y = rng.uniform(*np.transpose([overhead.table.x, overhead.table.y]))
        drop = 0.015
        if number % 2:
            (x, y), drop = nearest(overhead, slot), 0.1
        over = Goal((*slot, kind.height + drop))
        start = planner.plan(home, Goal((x, y, kind.height))).end
        shares.append(least.get_transport_time(bin) / planner.plan(start, over, Task(Load(kind))).duration)
    clearance.close()
    assert max(shares) < 0.9
    assert np.mean(shares) > 0.4, "else it is of little use"


def test_the_bins_differ_and_no_bin_means_the_nearest(overhead, least) -> None:
    times = {bin: least.get_transport_time(bin) for bin in overhead.bins}
    assert times == pytest.approx(
        {"red_bin": 0.34913, "blue_bin": 0.379096, "yellow_bin": 0.328779}, rel=1e-5
    )
    assert least.get_transport_time(None) == min(times.values())
    assert least.get_transport_time("grey_bin") == 0.0
    assert SimMinTimes(changed(overhead, "table", x=(1.2, 1.4))).get_transport_time("red_bin") == 0.0, (
        "out of reach"
    )


def test_a_descent_may_end_early_on_an_object_higher_than_expected(overhead: CellConfig) -> None:
    """The objects differ by 10 mm in height, and the lip feels a surface 1 mm away."""
    slow = changed(overhead, "motion", descent=0.03, slow_descent=0.02, descent_speed=0.03)
    long = SimMinTimes(slow)
    assert long.descent_time == pytest.approx((0.020 - 0.010 - 0.001) / 0.03)
    assert SimMinTimes(changed(overhead, "motion", descent=0.008, slow_descent=0.02)).descent_time == 0.0
    cubes = overhead.model_copy(update={"objects": {"cube": overhead.objects["cube"]}})
    motion = overhead.motion
    assert SimMinTimes(cubes).descent_time == pytest.approx(
        (motion.slow_descent - 0.001) / motion.descent_speed
    )


def test_a_detector_answers_after_its_latency(overhead) -> None:
    slow = overhead.detectors["embedded"].model_copy(update={"latency": 0.7})
    least = SimCell.min_times(overhead.model_copy(update={"detectors": {**overhead.detectors, "slow": slow}}))
    assert [least.get_answer_time(name) for name in ("", "embedded", "slow", "none")] == [
        0.05,
        0.05,
        0.7,
        0.0,
    ]
