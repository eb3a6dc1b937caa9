"""The benchmark of motion: its scenes, its gauge, its rivals, and a pair of each kind."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from executive.arm import Goal
from executive.cell_config import CellConfig
from executive.cli.cells import load_cells
from executive.errors import Blocked, InputError
from executive.geometry import Pose
from executive.layout import as_class, travel_height
from executive.messages import Obstacle
from executive.motion.kinematics import Kinematics
from executive.motion.limits import JointLimits
from executive.motion.planner import Planner
from executive.motion.postures import find_postures
from executive.motion.trajectory import peaks
from executive.sim.tool import SuctionTool
from executive.sim.world import World
from tests.benchmarks import motion
from tests.benchmarks import motion_rivals as rivals
from tests.benchmarks.motion_execution import execute_pairs
from tests.benchmarks.motion_gauge import Gauge
from tests.benchmarks.motion_scenes import Scene, open_world

PLACE = (0.5, 0.0)


@pytest.fixture(scope="module")
def cell() -> CellConfig:
    return load_cells(("overhead",))["overhead"]


@pytest.fixture(scope="module")
def kinematics(cell: CellConfig) -> Kinematics:
    return Kinematics(cell.tool.length, JointLimits.of(cell.arm.limits).position)


class Table:
    """A cube to pick, and an arm that can be put over the table."""

    def __init__(self, cell: CellConfig, kinematics: Kinematics, world: World) -> None:
        self.world, self._kinematics = world, kinematics
        self.body = world.add_object("cube", Pose.of([*PLACE, 0.025]), (1, 1, 1))
        kind = as_class("cube", cell.objects["cube"])
        target = Obstacle(*PLACE, 0.0354, 0.05, "cube-1")
        goal = Goal((*PLACE, 0.035), guarded=0.021)
        self.scene = Scene(self.body, kind, 0.051, 7.9, target, (), goal, Goal((0.24, 0.48, 0.065)))
        self.gauge = Gauge(world, cell.motion.margin)

    def put_tool(self, x: float, z: float) -> None:
        self.world.set_arm(find_postures(self._kinematics, Goal((x, 0.0, z)), 0.0, np.zeros(7)).low[0])

    def carry_to(self, x: float) -> None:
        """Put the cube into the tool, 3 mm over the table."""
        self.put_tool(x, 0.053)
        self.world.place_object(self.body, Pose.of([x, 0.0, 0.028]))


@pytest.fixture
def table(cell: CellConfig, kinematics: Kinematics) -> Iterator[Table]:
    world = World(cell, visuals=False)
    yield Table(cell, kinematics, world)
    world.close()


def test_the_target_counts_except_on_the_straight_way_down(table: Table) -> None:
    table.put_tool(0.5, 0.054)
    table.gauge.measure(table.scene)
    assert table.gauge.nearest != "the tool - a cube" and table.gauge.least > 0.01
    for x, z, distance in ((0.5, 0.060, 0.010), (0.504, 0.054, 0.004), (0.5, 0.075, 0.004)):
        table.put_tool(x, z)
        table.gauge.measure(table.scene)
        assert (table.gauge.nearest, table.gauge.least) == (
            "the tool - a cube", pytest.approx(distance, abs=1e-3),
        )  # fmt: skip


@pytest.mark.parametrize(
    ("places", "counted"),
    [((0.499, 0.490), None), ((0.501,), 0.002), ((0.490, 0.499), 0.004)],
    ids=["a near object may part", "it must not come nearer", "once apart, it counts again"],
)
def test_a_near_object_is_spared_until_it_is_apart(
    table: Table, places: tuple[float, ...], counted: float | None
) -> None:
    table.world.add_object("cube", Pose.of([PLACE[0] + 0.053, 0.0, 0.025]), (1, 1, 1))
    table.carry_to(PLACE[0])
    table.gauge.begin(table.scene, held=table.body)
    for x in places:
        table.carry_to(x)
        table.gauge.measure(table.scene, held=table.body)
    if counted is None:
        assert table.gauge.least > 0.01
    else:
        assert table.gauge.nearest == "the held cube - a cube"
        assert table.gauge.least == pytest.approx(counted, abs=2e-4)


def test_the_rivals_are_in_order_and_pass_the_corners(cell: CellConfig) -> None:
    planner = Planner(cell)
    arm, limits = planner.kinematics, planner.limits
    touch, drop = Goal((0.5, 0.1, 0.051)), Goal((0.24, -0.48, 0.065))
    start = find_postures(arm, Goal((0.24, 0.48, 0.065)), 0.1, np.zeros(7)).low[0]
    height = travel_height(cell)
    chains = rivals.find_chains(arm, limits, start, touch, drop, height)
    tips, _ = arm.tips(np.concatenate(chains))
    high_object, high_bin = (0.5, 0.1, height), (0.24, -0.48, height)
    fetch = [(0.24, 0.48, 0.065), (0.24, 0.48, height), high_object, touch.position]
    assert tips == pytest.approx(np.array([*fetch, touch.position, high_object, high_bin, drop.position]))
    stopping, passing = (
        [follow(chain, limits) for chain in chains]
        for follow in (rivals.stop_at_corners, rivals.follow_with_toppra)
    )
    floor, states = rivals.find_floor(arm, limits, start, touch, drop)
    assert 0.5 < floor < passing[0][0] + passing[1][0] < stopping[0][0] + stopping[1][0] < rivals.ARTICLE_S
    assert arm.forward(states[1].q[-1]).position == pytest.approx(drop.position, abs=1e-6)
    assert peaks(stopping[0][1], limits).max() == pytest.approx(1.0, abs=1e-3)
    assert peaks(passing[0][1], limits)[2].max() > 5.0
    for corner in chains[0]:
        assert np.abs(passing[0][1].q - corner).max(axis=1).min() < 0.02


@pytest.mark.slow
def test_planned_and_executed_pairs_have_plausible_figures(cell: CellConfig) -> None:
    figures = motion.measure(cell, seed=5, pairs=2, execute=2)
    assert (figures["planned_pairs"], figures["executed_pairs"], figures["problems"]) == (2, 2, [])
    times = {row["method"]: row["time_s"] for row in figures["methods"]}
    assert times["floor"] < times["ours"] < times["stops at corners"] < figures["article_s"] == 6.5
    assert figures["clearance_mm"] > 4.9 and 0 < figures["slip_mm"] < 1
    assert (figures["missed"], figures["dropped"]) == (0, 0)


@pytest.mark.slow
def test_a_dropped_object_and_a_missing_motion_are_found(
    cell: CellConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    bear, steps = SuctionTool._bear, []

    def wear_out(self: SuctionTool, grip: object) -> None:
        steps.append(grip)
        grip.bears = grip.bears if len(steps) < 100 else 0.0
        bear(self, grip)

    monkeypatch.setattr(SuctionTool, "_bear", wear_out)
    figures = execute_pairs(cell, 1, 5)
    assert (figures["dropped"], figures["problems"]) == (1, ["an object was dropped"])

    def block(self: Planner, start: object, goal: object, task: object = None) -> None:
        raise Blocked("a wall")

    with open_world(cell) as (world, planner):
        trial = motion._Trial(cell, world, planner, 5)
        monkeypatch.setattr(Planner, "plan", block)
        trial.plan_pair()
        with pytest.raises(InputError, match="no motion was found in cell overhead: a wall"):
            trial.collect_figures()
