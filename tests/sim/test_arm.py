from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml

from executive.cell import Via
from executive.cell_config import CellConfig
from executive.errors import Fault
from executive.motion.kinematics import Kinematics
from executive.motion.limits import JointLimits
from executive.motion.planner import Planner
from executive.sim.arm import SimArm
from executive.sim.world import World

OVER = [Via(np.array([0.5, 0.1, 0.15]))]


class Rig:
    """The arm of the shipped overhead cell over its table."""

    def __init__(self, config: CellConfig) -> None:
        self.world = World(config)
        self.limits = JointLimits.of(config.arm.limits)
        kinematics = Kinematics(config.tool.length, self.limits.position)
        planner = Planner(kinematics, self.limits)
        self.arm = SimArm(self.world, planner, self.limits, config.arm, travel_height=0.1)

    def step(self, count: int = 1) -> None:
        for _ in range(count):
            self.arm.advance()
            self.world.step()

    def run(self, most: int = 2000) -> int:
        """Step until the arm rests and return how many steps that took."""
        for count in range(most):
            if self.arm.at_rest:
                return count
            self.step()
        raise AssertionError(f"still moving after {most} steps")


@pytest.fixture(scope="module")
def config(missions: Path) -> CellConfig:
    return CellConfig(**yaml.safe_load((missions / "cells" / "overhead.yaml").read_text(encoding="utf-8")))


@pytest.fixture
def rig(config: CellConfig) -> Iterator[Rig]:
    rig = Rig(config)
    yield rig
    rig.world.close()


def test_it_follows_a_motion_to_a_hundredth_of_a_degree(rig: Rig) -> None:
    motion = rig.arm.plan(OVER)
    rig.arm.start(motion)
    for step in range(1, math.ceil(motion.duration * 240) + 1):
        rig.step()
        assert np.max(np.abs(rig.arm.q - motion.at(step / 240)[0])) < math.radians(0.01)
    assert rig.arm.at_rest
    assert np.allclose(rig.arm.tool_pose.position, OVER[0].position, atol=1e-4)


def test_it_holds_its_place_when_idle(rig: Rig) -> None:
    before = rig.arm.q
    rig.arm.stop()
    rig.step(120)
    assert rig.arm.at_rest
    assert np.max(np.abs(rig.arm.q - before)) < math.radians(0.01)


def test_a_halt_stays_on_the_path_and_the_arm_can_go_on_from_there(rig: Rig) -> None:
    motion = rig.arm.plan(OVER)
    rig.arm.start(motion)
    rig.step(int(motion.duration * 120))
    rig.arm.stop()
    rig.arm.stop()
    assert not rig.arm.at_rest
    assert rig.run() <= 120
    way, done = motion.end - motion.start, rig.arm.q - motion.start
    share = (done @ way) / (way @ way)
    assert 0.5 < share < 1
    assert np.allclose(done, share * way, atol=math.radians(0.01))

    rig.arm.start(rig.arm.plan(OVER))
    rig.run()
    assert np.allclose(rig.arm.tool_pose.position, OVER[0].position, atol=1e-4)


def test_starting_or_planning_while_moving_is_a_fault(rig: Rig) -> None:
    motion = rig.arm.plan(OVER)
    rig.arm.start(motion)
    rig.step(10)
    with pytest.raises(Fault, match=r"start a motion while moving \(\d\.\d\d s to go\)"):
        rig.arm.start(motion)
    with pytest.raises(Fault, match="plan a motion while moving"):
        rig.arm.plan(OVER)


def test_a_motion_that_starts_elsewhere_is_a_fault_with_numbers(rig: Rig) -> None:
    motion = rig.arm.plan(OVER)
    rig.arm.start(motion)
    rig.run()
    with pytest.raises(Fault, match=r"starts \d+\.\d\d° away from where joint \d of the arm is; 0\.2° are"):
        rig.arm.start(motion)
    rig.arm.start(rig.arm.plan_to_pose("home"))


def test_an_arm_pushed_off_its_path_brakes_and_says_so(rig: Rig) -> None:
    rig.arm.start(rig.arm.plan(OVER))
    rig.step(30)
    rig.world.set_arm(rig.arm.q + np.radians([0, 3, 0, 0, 0, 0, 0]))
    rig.step(2)
    with pytest.raises(Fault, match=r"the command is \d\.\d\d° away from where joint 2 of the arm is; 0\.5°"):
        _ = rig.arm.at_rest
    assert rig.run() <= 120


def test_it_goes_up_before_it_leaves_for_a_named_pose(rig: Rig) -> None:
    rig.arm.start(rig.arm.plan([*OVER, Via(np.array([0.5, 0.1, 0.06]))]))
    rig.run()
    rig.arm.start(rig.arm.plan_to_pose("home"))
    while rig.arm.tool_pose.position[2] < 0.098:
        assert np.allclose(rig.arm.tool_pose.position[:2], [0.5, 0.1], atol=0.002)
        rig.step()
    rig.run()
    assert np.allclose(rig.arm.q, np.radians(rig.world.config.arm.poses_deg["home"]), atol=1e-4)


def test_an_unknown_pose_is_a_fault_that_lists_the_known_ones(rig: Rig) -> None:
    with pytest.raises(Fault, match='no arm pose "hime"; it has aside, home'):
        rig.arm.plan_to_pose("hime")
