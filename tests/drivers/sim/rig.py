"""The arm of a cell file with its tool over its table, stepped by hand."""

from __future__ import annotations

from collections import deque

import numpy as np

from executive.cell.arm import Goal, MotionGuard, Task
from executive.cell.config import CellConfig
from executive.cell.devices import StepClock
from executive.drivers.sim.arm import SimArm
from executive.drivers.sim.world import World
from executive.events import discard_event
from executive.geometry import Array, Pose
from executive.motion.planner import Planner
from executive.motion.trajectory import Trajectory
from executive.physics.collision import ClearanceChecker
from executive.station.planner_service import PlannedArm, PlannerService

WHITE = (1.0, 1.0, 1.0)


class Rig:
    """An arm, its tool and nothing on the table, each part as driver and station make it.

    Attributes:
        arm: The arm as skills see it.
        device: The arm of the driver.
        commands: Joint positions `(7,)` [rad] that the arm was sent to last, newest at the end.
    """

    def __init__(self, config: CellConfig) -> None:
        self.config = config
        self.world = World(config)
        self.clearance = ClearanceChecker(config)
        self.planner = Planner(config, self.clearance.check)
        self.clock = StepClock()
        self.clock.on_tick = self._advance
        self.tool = config.tool.build_sim(self.world)
        self.device = SimArm(self.world, self.tool, self.planner.limits)
        self.service = PlannerService(
            self.planner.plan, self.clock, config.motion.planning_time, discard_event, self.clearance.close
        )
        poses = {name: np.radians(pose) for name, pose in config.arm.poses_deg.items()}
        self.arm = PlannedArm(self.device, self.service, self.planner.kinematics, poses)
        self.commands = deque([self.device.q], maxlen=400)

    def add(self, label: str, x: float, y: float, z: float | None = None) -> int:
        """Put an object into the world, standing at (x, y) or with its middle at height z [m]."""
        height = self.config.objects[label].height / 2 if z is None else z
        return self.world.add_object(label, Pose.of([x, y, height]), WHITE)

    def step(self, count: int = 1) -> None:
        """Make control steps."""
        for _ in range(count):
            self.clock.wait_for_tick()

    def _advance(self) -> None:
        self.device.advance()
        self.commands.append(self.device.commanded_q)
        self.world.step()
        self.tool.advance()

    def planned(self, goal: Goal | str, task: Task = Task()) -> Trajectory:
        """Return a motion, once it is known."""
        planning = self.arm.plan(goal, task)
        while not planning.ready:
            self.step()
        return planning.result()

    def run(self, most: int = 2000) -> int:
        """Step until the arm rests and return how many steps that took."""
        for count in range(most):
            if self.arm.at_rest:
                return count
            self.step()
        raise AssertionError(f"still moving after {most} steps")

    def go(self, goal: Goal | str, task: Task = Task()) -> Trajectory:
        """Plan a motion, follow it to its end and return it."""
        motion = self.planned(goal, task)
        self.arm.start(motion)
        self.run()
        return motion

    def touch_down(self, goal: Goal) -> tuple[Array, float]:
        """Follow a motion with a guard that lets the arm brake as soon as the tool feels something.

        Returns:
            Where the tool felt it `(3,)` [m], and the largest force of its lip until it was at rest [N].
        """
        self.arm.start(self.planned(goal), MotionGuard(touch=True))
        while not (self.tool.touching or self.arm.at_rest):
            self.step()
        felt, force = self.arm.tool_pose.position, self.pressing()
        while not self.arm.at_rest:
            self.step()
            force = max(force, self.pressing())
        return felt, force

    def pressing(self) -> float:
        """Return the force between the tool and everything else [N]."""
        points = self.world.client.getContactPoints(bodyA=self.world.arm, linkIndexA=self.world.tool_index)
        return float(sum(point[9] for point in points))

    def close(self) -> None:
        """End the planner and give both worlds back."""
        self.service.close()
        self.world.close()
