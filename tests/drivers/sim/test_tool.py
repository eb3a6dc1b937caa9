from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pybullet
import pytest

from executive.drivers.sim.world import World
from executive.geometry import GRAVITY, Array, Pose
from executive.motion.joints import build_kinematics
from executive.physics.cell_world import NORMAL_FORCE
from tests.motion.joint_states import CONFIG, reach

X, Y = 0.5, 0.05
CUBE = 0.05
GOOD_PLACE = {"cube": 0.0, "sphere": 0.0, "duck": -0.01}
"""Where along x from its origin an object is held well [m]: the duck at the top of its head."""


class Bench:
    """A tool over one object on the table, and an arm that is simply put where it should be."""

    def __init__(self, label: str) -> None:
        self.world = World(CONFIG)
        self.config = CONFIG.tool
        self.tool = CONFIG.tool.build_sim(self.world)
        self.kinematics = build_kinematics(CONFIG)
        self.q: Array = np.radians(CONFIG.arm.poses_deg["home"])
        self.body = self.world.add_object(label, Pose.of([X - GOOD_PLACE[label], Y, CUBE / 2]), (1, 1, 1))
        self.steps(120)
        self.top = float(self.world.client.rayTest([X, Y, 0.3], [X, Y, 0.0])[0][3][2])

    def put(self, height: float, dx: float = 0.0) -> None:
        """Put the lip `height` [m] over the object's top, `dx` [m] beside its good place."""
        self.q = reach(self.kinematics, (X + dx, Y, self.top + height), self.q)
        self.world.set_joint_positions(self.q)
        self.steps(1)

    def raise_by(self, height: float, steps: int = 240) -> None:
        """Lift the tool smoothly."""
        start = self.world.get_tool_pose().position
        for i in range(1, steps + 1):
            s = i / steps
            goal = start + np.array([0, 0, height * s * s * (3 - 2 * s)])
            self.q = reach(self.kinematics, goal, self.q)
            self.steps(1)

    def steps(self, count: int, pull: float = 0.0) -> None:
        """Make physics steps with the arm held still and `pull` [N] downwards on the object."""
        for _ in range(count):
            self.world.client.setJointMotorControlArray(
                self.world.arm, range(7), pybullet.POSITION_CONTROL, self.q, positionGains=[1.0] * 7
            )
            if pull:
                at = self.world.client.getBasePositionAndOrientation(self.body)[0]
                self.world.client.applyExternalForce(self.body, -1, [0, 0, -pull], at, pybullet.WORLD_FRAME)
            self.world.step()
            self.tool.advance()

    def hang(self) -> None:
        """Seal the object on at its good place and lift it into the air."""
        self.put(0.0012)
        self.tool.close()
        assert self.tool.holding
        self.raise_by(0.1)
        self.steps(60)

    def pose_in_tool(self) -> Pose:
        """Return the object's pose in the tool's frame."""
        X_WB = Pose.of(*self.world.client.getBasePositionAndOrientation(self.body))
        return self.world.get_tool_pose().inverse() @ X_WB


@pytest.fixture
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    """A tool over a cube, or over an object of the class that the param names."""
    bench = Bench(getattr(request, "param", "cube"))
    yield bench
    bench.world.close()


def test_a_vacuum_already_on_seals_on_what_comes_within_reach(bench: Bench) -> None:
    bench.put(0.01)
    bench.tool.close()
    bench.put(0.0025)
    assert not bench.tool.holding
    bench.put(0.0015)
    assert bench.tool.holding


@pytest.mark.parametrize("bench", ["cube", "sphere", "duck"], indirect=True)
def test_a_held_object_keeps_the_pose_it_had_at_contact_and_pulls_with_its_weight(bench: Bench) -> None:
    bench.put(0.0012)
    before = bench.pose_in_tool()
    bench.tool.close()
    bench.raise_by(0.1)
    bench.steps(60)
    after = bench.pose_in_tool()
    assert bench.tool.holding
    assert after.position == pytest.approx(before.position, abs=2e-4)
    assert after.rotation == pytest.approx(before.rotation, abs=5e-3)
    assert bench.tool.pull == pytest.approx(0.1 * 9.81, rel=0.05)


def test_the_gauge_tells_what_the_seal_bears_until_nothing_is_held(bench: Bench) -> None:
    assert bench.tool.holding_force == 0.0
    bench.hang()
    force = bench.tool.holding_force
    assert force == pytest.approx(bench.config.force, rel=0.2)
    weight = 0.1 * 9.81
    bench.steps(60, pull=0.95 * force - weight)
    assert bench.tool.holding_force == force
    bench.steps(60, pull=1.05 * force - weight)
    assert (bench.tool.holding, bench.tool.holding_force) == (False, 0.0)


def test_a_seal_that_gave_way_forms_again_only_after_the_vacuum_was_off_or_the_cup_clear(
    bench: Bench,
) -> None:
    bench.put(0.0005)
    bench.tool.close()
    bench.tool.lose_grip()
    assert not bench.tool.holding
    bench.steps(60)
    assert bench.tool.touching and not bench.tool.holding
    bench.tool.open()
    bench.tool.close()
    assert bench.tool.holding


def test_the_pull_of_an_object_on_its_support_does_not_break_the_seal(bench: Bench) -> None:
    bench.put(0.0005)
    bench.tool.close()
    bench.steps(60, pull=1.5 * bench.config.force)
    assert bench.tool.holding and bench.tool.pull == 0


@pytest.mark.parametrize("bench", ["cube", "duck"], indirect=True)
def test_the_bellows_yields_to_pressure_and_springs_back(bench: Bench) -> None:
    bench.put(0.0005)
    before = bench.pose_in_tool().position
    bench.tool.close()
    bench.raise_by(-0.0015)
    forces = []
    for _ in range(60):
        bench.steps(1)
        contacts = bench.world.client.getContactPoints(bodyA=bench.body)
        forces.append(sum(point[NORMAL_FORCE] for point in contacts))
    assert np.mean(forces) == pytest.approx(bench.config.force * 1.5 / 2.5 + 0.98, rel=0.3)
    assert max(forces) < 1.5 * bench.config.force
    bench.raise_by(0.1)
    bench.steps(60)
    assert bench.tool.holding
    assert bench.pose_in_tool().position == pytest.approx(before, abs=5e-4)


def test_opening_drops_the_object_and_lets_it_collide_with_the_tool_again(bench: Bench) -> None:
    bench.hang()
    assert not bench.world.client.getContactPoints(bench.world.arm, bench.body)
    bench.tool.open()
    assert not bench.tool.holding
    assert bench.tool.pull == 0
    assert bench.tool.held_body is None
    bench.steps(240)
    assert bench.pose_in_tool().position[2] > 0.1
    bench.put(-0.0005)
    assert bench.world.client.getContactPoints(bench.world.arm, bench.body)


def test_the_load_of_a_hanging_object_is_its_weight_and_noise_of_the_declared_size(bench: Bench) -> None:
    first = bench.tool.load
    assert first == pytest.approx(0.0, abs=5 * bench.tool.load_std)
    assert bench.tool.load == first != bench.config.build_sim(bench.world, noise_seed=1).load
    bench.hang()
    loads = []
    for _ in range(300):
        bench.steps(1)
        loads.append(bench.tool.load)
    mass = bench.world.client.getDynamicsInfo(bench.body, -1)[0]
    assert np.mean(loads) == pytest.approx(mass * GRAVITY, abs=4 * bench.tool.load_std / 300**0.5)
    assert np.std(loads) == pytest.approx(bench.tool.load_std, rel=0.15)
