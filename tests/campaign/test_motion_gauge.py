"""What counts as near, and what may be touched."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest

from executive.arm import Goal
from executive.campaign.motion_gauge import Gauge
from executive.campaign.motion_scenes import Scene
from executive.cell_config import CellConfig
from executive.geometry import Pose
from executive.layout import as_class
from executive.messages import Obstacle
from executive.motion.kinematics import Kinematics
from executive.motion.limits import JointLimits
from executive.motion.postures import find_postures
from executive.sim.world import World

PLACE = (0.5, 0.0)
TARGET = Obstacle(*PLACE, 0.0354, 0.05, "cube-1")


@dataclass
class Table:
    """A cube to pick, and an arm that can be put over the table."""

    world: World
    kinematics: Kinematics
    scene: Scene
    gauge: Gauge

    def put_tool(self, x: float, y: float, z: float) -> None:
        found = find_postures(self.kinematics, Goal((x, y, z)), 0.0, np.zeros(7))
        self.world.set_arm(found.low[0])

    def press(self) -> None:
        """Let the arm, whose motors are off, lie on what is under the tool for a moment."""
        for _ in range(3):
            self.world.step()
            self.gauge.feel(self.scene)


@pytest.fixture
def table(overhead: CellConfig) -> Iterator[Table]:
    world = World(overhead, visuals=False)
    body = world.add_object("cube", Pose.of([*PLACE, 0.025]), (1, 1, 1))
    kind = as_class("cube", overhead.objects["cube"])
    goal = Goal((*PLACE, 0.035), guarded=0.021)
    scene = Scene(body, kind, PLACE, 0.051, 7.9, TARGET, (), goal, Goal((0.24, 0.48, 0.065)))
    kinematics = Kinematics(overhead.tool.length, JointLimits.of(overhead.arm.limits).position)
    yield Table(world, kinematics, scene, Gauge(world, overhead.motion.margin))
    world.close()


def test_the_target_does_not_count_on_the_straight_way_down(table):
    table.put_tool(*PLACE, 0.054)
    table.gauge.measure(table.scene)
    assert table.gauge.least.what != "the tool - a cube"
    assert table.gauge.least.distance > 0.01


@pytest.mark.parametrize(("x", "z", "distance"), [(0.5, 0.060, 0.010), (0.504, 0.054, 0.004)])
def test_it_counts_above_that_way_and_beside_it(table, x, z, distance):
    table.put_tool(x, 0.0, z)
    table.gauge.measure(table.scene)
    assert table.gauge.least.what == "the tool - a cube"
    assert table.gauge.least.distance == pytest.approx(distance, abs=1e-3)


@pytest.mark.parametrize(("x", "table_counts"), [(0.5, False), (0.56, True)])
def test_the_table_under_a_load_counts_as_soon_as_it_has_left_its_place(table, x, table_counts):
    table.put_tool(x, 0.0, 0.055)
    table.world.place_object(table.scene.body, Pose.of([x, 0.0, 0.030]))
    table.gauge.measure(table.scene, held=table.scene.body)
    assert (table.gauge.least.what == "the held cube - the table") is table_counts
    if table_counts:
        assert table.gauge.least.distance == pytest.approx(0.005, abs=1e-3)


def test_the_nearest_of_all_moments_is_kept(table):
    for z in (0.070, 0.058, 0.075):
        table.put_tool(*PLACE, z)
        table.gauge.measure(table.scene)
    assert table.gauge.least.distance == pytest.approx(0.008, abs=1e-3)


def carried(table, x: float) -> None:
    """The cube in the tool, 3 mm over the table."""
    table.put_tool(x, 0.0, 0.053)
    table.world.place_object(table.scene.body, Pose.of([x, 0.0, 0.028]))


@pytest.mark.parametrize(
    ("places", "counted"),
    [
        ((0.499, 0.490), None),
        ((0.501,), 0.002),
        ((0.490, 0.499), 0.004),
    ],
    ids=["what stood nearer may part", "it must not come nearer still", "once apart, it counts again"],
)
def test_what_stood_near_as_the_motion_began_is_spared_until_it_is_apart(table, places, counted):
    table.world.add_object("cube", Pose.of([PLACE[0] + 0.053, 0.0, 0.025]), (1, 1, 1))
    carried(table, PLACE[0])
    table.gauge.begin(table.scene, held=table.scene.body)
    for x in places:
        carried(table, x)
        table.gauge.measure(table.scene, held=table.scene.body)
    if counted is None:
        assert table.gauge.least.distance > 0.01
    else:
        assert table.gauge.least.what == "the held cube - a cube"
        assert table.gauge.least.distance == pytest.approx(counted, abs=2e-4)


def test_a_contact_that_is_not_allowed_is_told(table):
    table.put_tool(PLACE[0] + 0.01, 0.0, 0.048)
    table.press()
    assert table.gauge.contacts == {"the tool - a cube"}


def test_the_touch_at_the_end_of_an_approach_is_no_contact(table):
    table.put_tool(*PLACE, 0.0495)
    table.press()
    assert table.gauge.contacts == set()
