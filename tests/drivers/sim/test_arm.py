"""The simulated arm's driver: what it plans, follows and refuses."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from rig import Rig

from executive.cell.arm import Goal, MotionGuard
from executive.errors import Fault
from executive.motion.trajectory import RETREAT_TIME

OVER = Goal((0.5, 0.1, 0.15))
BESIDE = Goal((0.5, -0.1, 0.15))


def test_it_follows_a_motion_to_a_hundredth_of_a_degree(rig: Rig) -> None:
    motion = rig.planned(OVER)
    rig.arm.start(motion)
    for step in range(1, math.ceil(motion.duration * 240) + 1):
        rig.step()
        assert np.max(np.abs(rig.device.q - motion.state_at(step / 240).q)) < math.radians(0.01)
    assert rig.arm.at_rest
    assert rig.arm.collision is None
    assert np.allclose(rig.arm.tool_pose.position, OVER.position, atol=1e-4)


def test_what_was_planned_ahead_is_of_no_use_once_the_arm_was_stopped_on_its_way(rig: Rig) -> None:
    rig.arm.start(rig.planned(OVER))
    rig.step(24)
    rig.arm.plan_ahead(BESIDE)
    rig.arm.stop()
    rig.arm.plan_ahead(BESIDE)  # from where it will stop, which nobody knows yet
    rig.run()
    planning = rig.arm.plan(BESIDE)
    assert not planning.ready
    rig.step(12)
    assert np.allclose(planning.result().start, rig.device.q, atol=1e-4)


def test_a_motion_that_starts_elsewhere_is_a_fault_with_numbers(rig: Rig) -> None:
    motion = rig.go(OVER)
    with pytest.raises(Fault, match=r"the start of the motion .* joint \d is .*° away; 0\.2°"):
        rig.arm.start(motion)
    rig.go("home")


def test_it_follows_one_motion_at_a_time_and_none_of_another_arm(rig: Rig) -> None:
    with pytest.raises(Fault, match="follows trajectories, not a str"):
        rig.device.execute("home", MotionGuard())  # type: ignore[arg-type]
    motion = rig.planned(OVER)
    rig.device.execute(motion, MotionGuard())
    with pytest.raises(Fault, match="start a motion while moving"):
        rig.device.execute(motion, MotionGuard())


def test_an_arm_pushed_off_its_path_reports_a_collision_and_moves_back(rig: Rig) -> None:
    motion = rig.planned(OVER)
    rig.arm.start(motion)
    rig.step(100)
    rig.world.set_joint_positions(rig.device.q + np.radians([0, 3, 0, 0, 0, 0, 0]))
    assert rig.run() <= 400
    assert rig.arm.collision is not None and re.search(r"joint 2 is \d\.\d\d° away; 0\.5°", rig.arm.collision)
    assert rig.device.q == pytest.approx(motion.state_at(100 / 240 - RETREAT_TIME).q, abs=1e-4)


def test_an_arm_pushed_away_at_rest_does_not_start_but_plans_from_its_new_position(rig: Rig) -> None:
    motion = rig.planned(OVER)
    rig.world.set_joint_positions(rig.device.q + np.radians([0, 3, 0, 0, 0, 0, 0]))
    rig.arm.start(motion)
    assert rig.arm.at_rest and rig.arm.collision is not None
    rig.go(OVER)
    assert rig.arm.collision is None


def test_its_tool_velocity_is_how_far_the_tool_gets_in_a_control_step(rig: Rig) -> None:
    rig.arm.start(rig.planned(Goal((0.55, -0.2, 0.2))))
    fastest = 0.0
    while not rig.arm.at_rest:
        before = rig.arm.tool_pose.position
        rig.step()
        gone = (rig.arm.tool_pose.position - before) * 240
        assert rig.arm.tool_velocity == pytest.approx(gone, abs=0.02)
        fastest = max(fastest, float(np.linalg.norm(gone)))
    assert fastest > 0.3
    rig.step(30)
    assert rig.arm.tool_velocity == pytest.approx(np.zeros(3), abs=1e-3)
