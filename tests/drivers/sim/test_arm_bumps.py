"""What the arm runs into although nothing was known to be there."""

from __future__ import annotations

import re

import numpy as np
import pybullet
import pytest
from rig import Rig

from executive.cell.arm import Goal, MotionGuard, Task
from executive.cell.objects import Obstacle
from executive.geometry import Array
from executive.motion.trajectory import RETREAT_TIME, Trajectory
from tests.benchmarks.halts import measure_distance

LEFT, RIGHT = Goal((0.5, 0.25, 0.15)), Goal((0.5, -0.2, 0.15))


def float_at(rig: Rig, label: str, place: Array, mass: float = 0.1) -> int:
    """Put an object into the air, where it stays until something runs into it."""
    rig.world.client.setGravity(0, 0, 0)
    body = rig.add(label, *place)
    rig.world.client.changeDynamics(body, -1, mass=mass)
    return body


def tool_at(rig: Rig, motion: Trajectory, share: float) -> Array:
    """Return where the tool is after a share of the time of a motion `(3,)` [m]."""
    return rig.planner.kinematics.compute_tool_pose(motion.state_at(share * motion.duration).q).position


def bump(rig: Rig, motion: Trajectory, earliest: float = 0.0) -> str:
    """Follow a motion until the arm runs into something; return what it says when it is at rest again.

    Before the path time `earliest` [s] nothing may be met.
    """
    rig.arm.start(motion)
    while rig.arm.collision is None:
        assert not rig.arm.at_rest, "it ran into nothing"
        s = rig.device.motion_time
        rig.step()
    assert s >= earliest, rig.arm.collision
    assert rig.run() <= 400
    assert rig.device.commanded_q == pytest.approx(motion.state_at(max(0.0, s - RETREAT_TIME)).q)
    assert measure_distance(rig.device.commanded_q, motion) < 1e-9
    assert rig.arm.collision is not None
    return rig.arm.collision


def test_an_object_in_the_way_of_the_tool_makes_the_arm_brake_along_its_path(rig: Rig) -> None:
    rig.go(LEFT)
    motion = rig.planned(RIGHT)
    place = tool_at(rig, motion, 0.5)
    body = float_at(rig, "cube", place)
    said = bump(rig, motion)
    found = re.fullmatch(r"the tool ran into something, with the tool at \((.*), (.*), (.*)\) m", said)
    assert found, said
    assert np.linalg.norm(np.array([float(value) for value in found.groups()]) - place) < 0.05
    assert rig.arm.destination == pytest.approx(rig.arm.tool_pose.position, abs=1e-4)
    rig.world.remove_object(body)
    rig.go(RIGHT)
    assert rig.arm.collision is None, "the next motion begins where the bump left the arm, and forgets it"
    assert rig.arm.tool_pose.position == pytest.approx(RIGHT.position, abs=1e-4)


def hold_cube(rig: Rig) -> Task:
    """Pick a cube; return the task of motions with it."""
    held = rig.add("cube", 0.5, 0.1)
    rig.step(60)
    rig.touch_down(Goal((0.5, 0.1, 0.045), guarded_length=0.012, guarded_speed=0.035))
    rig.tool.close()
    assert rig.tool.held_body == held
    return Task(rig.config.objects["cube"].build_class("cube"), rig.tool.holding_force)


def test_a_load_that_touches_the_table_ends_a_guarded_descent_without_a_collision(rig: Rig) -> None:
    task = hold_cube(rig)
    goal = Goal((0.5, -0.1, 0.045), guarded_length=0.01, guarded_speed=0.035)
    rig.arm.start(rig.planned(goal, task), MotionGuard(touch=True, lost_grip=True))
    rig.run()
    assert (rig.arm.collision, rig.tool.holding) == (None, True)
    assert rig.arm.tool_pose.position == pytest.approx([0.5, -0.1, 0.05], abs=1.5e-3)


def test_what_the_held_object_runs_into_counts_but_neither_the_tool_nor_the_table_it_lay_on(rig: Rig) -> None:
    task = hold_cube(rig)
    rig.go(LEFT, task)
    assert rig.arm.collision is None
    motion = rig.planned(RIGHT, task)
    # So light that the seal does not break, so heavy that it is felt.
    float_at(rig, "sphere", tool_at(rig, motion, 0.5) - (0, 0, 0.06), mass=0.02)
    assert bump(rig, motion).startswith("the held object ran into something, with the tool at")
    assert rig.tool.holding


@pytest.mark.parametrize("mass", [0.0, 1000.0], ids=["fixed", "heavy"])
def test_an_unknown_obstacle_blocks_each_motion_and_breaks_nothing(rig: Rig, mass: float) -> None:
    rig.go(LEFT)
    x, y, z = tool_at(rig, rig.planned(RIGHT), 0.5)
    shape = rig.world.client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[0.03, 0.03, z / 2])
    post = rig.world.client.createMultiBody(mass, shape, basePosition=[x, y, z / 2])
    for _ in range(3):
        assert bump(rig, rig.planned(RIGHT)).startswith("the tool ran into something")
        assert rig.world.client.getClosestPoints(rig.world.arm, post, 0.0) == (), "it moved back"
    contact_x, contact_y, contact_z = rig.arm.contact_point or (0, 0, 0)
    task = Task(obstacles=(Obstacle(contact_x, contact_y, 0.0354, contact_z + 0.03, "the post"),))
    rig.go(RIGHT, task)
    assert rig.arm.collision is rig.arm.contact_point is None, "a motion around the contact point is free"
    rig.go("home")
    assert rig.arm.collision is None
