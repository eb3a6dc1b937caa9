"""Bounds of what things take: below everything that the arm can do, yet of use."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from executive.cell import Via
from executive.cell_config import CellConfig
from executive.geometry import Array, tool_down
from executive.layout import as_bin, as_class, travel_height
from executive.mission.parse.cell_file import load_cell
from executive.motion.kinematics import Kinematics
from executive.motion.limits import JointLimits
from executive.motion.planner import Planner
from executive.sim.cell import SimCell
from executive.sim.clearance import PathClearance
from executive.sim.least_times import SimLeastTimes


@pytest.fixture(scope="module")
def config(missions: Path) -> CellConfig:
    return load_cell(missions / "cells" / "overhead.yaml")


@pytest.fixture(scope="module")
def limits(config: CellConfig) -> JointLimits:
    return JointLimits.of(config.arm.limits)


@pytest.fixture(scope="module")
def kinematics(config: CellConfig, limits: JointLimits) -> Kinematics:
    return Kinematics(config.tool.length, limits.position)


@pytest.fixture(scope="module")
def least(config: CellConfig) -> SimLeastTimes:
    return SimLeastTimes(config)


def changed(config: CellConfig, section: str, **values: object) -> CellConfig:
    """Return the cell with other values in one of its sections."""
    return config.model_copy(update={section: getattr(config, section).model_copy(update=values)})


def test_no_planned_carry_is_faster_than_the_least(config, limits, kinematics, least) -> None:
    clearance = PathClearance(config)
    planner = Planner(kinematics, limits, clearance.check)
    rng, high = np.random.default_rng(3), travel_height(config)
    shares = []
    for number in range(12):
        bin = list(config.bins)[number % 3]
        label = list(config.objects)[number // 3 % 3]
        kind = as_class(label, config.objects[label])
        x, y = rng.uniform(*config.table.x), rng.uniform(*config.table.y)
        slot = rng.permutation(as_bin(bin, config.bins[bin]).slots)[0]
        down = [Via(np.array([x, y, z])) for z in (high, kind.height)]
        start = planner.plan(np.radians(config.arm.poses_deg["home"]), down).end
        over = [Via(np.array(place)) for place in ([x, y, high], [*slot, high], [*slot, kind.height + 0.015])]
        shares.append(least.carry(bin) / planner.plan(start, over, kind).duration)
    clearance.close()
    assert max(shares) < 0.6  # today's arm stops at travel height; one that does not must stay above too
    assert min(shares) > 0.15


def passing(way: Array, limits: JointLimits) -> Array:
    """Return the least times [s] in which joints 1-6 go `way` `(..., 6)` [rad] from rest, to any speed."""
    v, a, j = limits.velocity[:6], limits.acceleration[:6], limits.jerk[:6]
    times = np.linspace(0, 2, 2001)[:, None]
    speed = np.minimum(np.where(times < a / j, j * times**2 / 2, a * times - a**2 / j / 2), v)
    covered = np.cumsum(speed * (times[1] - times[0]), axis=0)
    each = [np.interp(np.abs(way[..., i]), covered[:, i], times[:, 0]) for i in range(6)]
    return np.max(each, axis=0)


def test_an_arm_that_flies_past_travel_height_at_full_speed_needs_the_least_time_too(
    config, limits, kinematics, least
) -> None:
    """Whatever is planned: no joint can be faster than its limits from rest to height and on to rest."""
    high, top = travel_height(config), max(kind.height for kind in config.objects.values())
    swivels = np.radians(np.arange(-180, 180, 30.0))

    def postures(x: float, y: float, z: float) -> Array:
        found = kinematics.grid(tool_down([x, y, z]), swivels).reshape(-1, 7)[:, :6]
        return found[np.all(np.abs(found) <= limits.position[:6], axis=1)]

    for name, section in config.bins.items():
        slots = as_bin(name, section).slots
        for x in np.linspace(*config.table.x, 3):
            for y in np.linspace(*config.table.y, 3):
                above = postures(x, y, high)
                rise = passing(above[:, None] - postures(x, y, top), limits).min(axis=1)
                ends = np.concatenate([postures(*slot, z) for slot in slots for z in (0.1, high)])
                ways = rise[:, None] + passing(above[:, None] - ends, limits)
                assert ways.min() > least.carry(name), (name, x, y)


def test_the_bins_differ_and_no_bin_means_the_nearest(config, least) -> None:
    times = {bin: least.carry(bin) for bin in config.bins}
    assert len(set(times.values())) == 3
    assert least.carry(None) == min(times.values()) > 0.3
    assert least.carry("grey_bin") == 0.0


def test_a_bin_farther_away_takes_longer(config, least) -> None:
    red = config.bins["red_bin"]
    far = red.model_copy(update={"position": (-0.4, -0.48, 0.0)})
    assert SimLeastTimes(config.model_copy(update={"bins": {"far": far}})).carry("far") > least.carry(
        "red_bin"
    )


def test_nothing_is_known_of_a_carry_from_where_the_arm_does_not_reach(config) -> None:
    assert SimLeastTimes(changed(config, "table", x=(1.2, 1.4))).carry("red_bin") == 0.0


def test_a_descent_may_end_early_on_an_object_higher_than_expected(config, least) -> None:
    assert least.descent == pytest.approx((0.020 - 0.010 - 0.001) / 0.03)
    assert SimLeastTimes(changed(config, "motion", descent=0.008)).descent == 0.0


def test_a_detector_answers_after_its_latency(config) -> None:
    slow = config.detectors["embedded"].model_copy(update={"latency": 0.7})
    least = SimCell.least_times(config.model_copy(update={"detectors": {**config.detectors, "slow": slow}}))
    assert [least.answer(name) for name in ("", "embedded", "slow", "none")] == [0.05, 0.05, 0.7, 0.0]
