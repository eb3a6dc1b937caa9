"""The benchmark of motion: its scenes, its monitor, its baselines, and a pair of each kind."""

from __future__ import annotations

import numpy as np
import pytest

from executive.cell.arm import Goal
from executive.cell.config import CellConfig
from executive.cell.layout import compute_travel_height
from executive.cells.sim.world import World
from executive.cli.cells import load_cells
from executive.geometry import Pose
from executive.motion.arm_model import Kinematics
from executive.motion.arms import build_kinematics, build_planner
from executive.motion.configurations import find_configuration_pairs
from executive.motion.trajectory import compute_peak_fractions
from tests.benchmarks import motion
from tests.benchmarks import motion_baselines as baselines
from tests.benchmarks.motion_execution import ClearanceMonitor
from tests.motion.joint_states import reach

PLACE = (0.5, 0.0)


@pytest.fixture(scope="module")
def cell() -> CellConfig:
    return load_cells(("overhead",))["overhead"]


@pytest.fixture(scope="module")
def kinematics(cell: CellConfig) -> Kinematics:
    return build_kinematics(cell)


def test_only_what_must_not_be_touched_counts(cell: CellConfig, kinematics: Kinematics) -> None:
    world = World(cell, visuals=False)
    cube, _ = (world.add_object("cube", Pose.of([x, 0.0, 0.025]), (1, 1, 1)) for x in (0.5, 0.62))
    monitor = ClearanceMonitor(world, cell.motion.margin)

    def move(held: int | None, touched: int | None, start: float, x: float, z: float) -> tuple[str, float]:
        for place, act in (((0.5, 0.0, start), monitor.begin), ((x, 0.0, z), monitor.measure)):
            world.set_joint_positions(reach(kinematics, place, np.zeros(7)))
            if held is not None:
                world.place_object(held, Pose.of([place[0], 0.0, place[2] - 0.025]))
            act(*((held, touched) if act == monitor.begin else (held,)))
        return monitor.nearest, monitor.min_distance

    assert move(None, cube, 0.2, 0.5, 0.054)[0] != "the tool - a cube"
    assert move(None, None, 0.054, 0.5, 0.054)[0] != "the tool - a cube"
    assert move(None, None, 0.2, 0.5, 0.060) == ("the tool - a cube", pytest.approx(0.010, abs=1e-3))
    assert move(cube, None, 0.053, 0.566, 0.053) == ("the held cube - a cube", pytest.approx(0.004, abs=2e-4))
    world.close()


def test_the_methods_are_in_order_and_pass_the_waypoints(cell: CellConfig) -> None:
    planner = build_planner(cell)
    arm, limits = planner.kinematics, planner.limits
    touch, drop = Goal((0.5, 0.1, 0.051)), Goal((0.24, -0.48, 0.065))
    start = find_configuration_pairs(arm, Goal((0.24, 0.48, 0.065)), 0.1, np.zeros(7)).lower_qs[0]
    height = compute_travel_height(cell)
    chains = baselines.find_waypoints(arm, limits, start, touch, drop, height)
    tips, _ = arm.compute_tcps_and_axes(np.concatenate(chains))
    high_object, high_bin = (0.5, 0.1, height), (0.24, -0.48, height)
    fetch = [(0.24, 0.48, 0.065), (0.24, 0.48, height), high_object, touch.position]
    assert tips == pytest.approx(np.array([*fetch, touch.position, high_object, high_bin, drop.position]))
    stopping, passing = (
        [follow(chain, limits) for chain in chains]
        for follow in (baselines.plan_with_stops, baselines.plan_with_toppra)
    )
    bound, states = baselines.find_lower_bound(arm, limits, start, touch, drop)
    assert 0.5 < bound < passing[0][0] + passing[1][0] < stopping[0][0] + stopping[1][0] < 6.5
    assert arm.compute_tool_pose(states[1].q[-1]).position == pytest.approx(drop.position, abs=1e-6)
    assert compute_peak_fractions(stopping[0][1], limits).max() == pytest.approx(1.0, abs=1e-3)
    assert compute_peak_fractions(passing[0][1], limits)[2].max() > 5.0
    for corner in chains[0]:
        assert np.abs(passing[0][1].q - corner).max(axis=1).min() < 0.02


@pytest.mark.slow
def test_planned_and_executed_pairs_have_plausible_figures(cell: CellConfig) -> None:
    figures = motion.measure(cell, seed=5, pairs=2)
    assert (figures["planned_pairs"], figures["problems"]) == (2, [])
    times = {row["method"]: row["time_s"] for row in figures["methods"]}
    assert times["lower bound"] < times["ours"] < times["stops at waypoints"]
    figures = motion.measure(cell, seed=5, pairs=2, execute=True)
    assert (figures["executed_pairs"], figures["problems"]) == (2, [])
    assert figures["clearance_mm"] > 4.9 and 0 < figures["slip_mm"] < 1
    assert (figures["missed"], figures["dropped"]) == (0, 0)
