"""The simulated arm's driver: follows planned motions step by step and brakes on demand."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from executive.cell.arm import Goal, Motion, Task, refuse_steps
from executive.cell.clock import STEP
from executive.cell.config import CellConfig
from executive.cell.protocols import Clock
from executive.cells.sim import command_log
from executive.cells.sim.contacts import Contacts
from executive.cells.sim.rebuild import UnderWay
from executive.cells.sim.world import World
from executive.errors import Fault
from executive.events import Emit, ignore
from executive.geometry import Array, Pose
from executive.motion.braking import brake
from executive.motion.planner import Planner
from executive.motion.plans import Plan, Plans
from executive.motion.trajectory import Trajectory

VELOCITY_INTERVAL = 1e-4
"""Time over which a tool velocity is taken [s]: too short for the arm to bend the way."""
START_TOLERANCE = math.radians(0.2)
"""Largest joint difference between the arm and the start of a motion [rad]."""
TRACKING_TOLERANCE = math.radians(0.5)
"""Largest joint difference between command and arm [rad]; undisturbed it is under 0.001°."""


class SimArm:
    """An arm in a PyBullet world, implementing `executive.cell.arm.Arm`.

    `advance` is called once before every physics step. It commands where the motion is one step later
    with full position gain and no velocity, which follows the path to 0.0005°; PyBullet's default gain
    without feed-forward lags by 3°.

    It brakes by itself where it is pushed off its path, or runs into something.

    Args:
        world: Its arm is taken over where it is.
        planner: Plans its motions.
        config: The cell file.
        clock: The run's.
        held: Returns the body that hangs at the tool, or None: its weight and what it hits are felt.
        emit: Tells the run what happens.
        under_way: What the arm was doing in a world that was rebuilt; it brakes. None: the arm is at rest.

    Attributes:
        planner: Plans its motions.
    """

    def __init__(
        self,
        world: World,
        planner: Planner,
        config: CellConfig,
        clock: Clock,
        held: Callable[[], int | None] = lambda: None,
        emit: Emit = ignore,
        under_way: UnderWay | None = None,
    ) -> None:
        self.planner = planner
        self._world = world
        self._poses = {name: np.radians(pose) for name, pose in config.arm.poses_deg.items()}
        self._plans = Plans(self._solve, clock, config.motion.planning, emit)
        self._contacts = Contacts(world, held)
        self._motion: Trajectory | None = None
        self._time = 0.0
        self._braking: list[float] | None = None
        self._fault: str | None = None
        self._met: str | None = None
        self._command = self.q
        # The log of a world may lack even the first command.
        if under_way is None or not under_way.command.size:
            self.hold()
        else:
            self._command, self._motion, self._time = under_way.command, under_way.motion, under_way.time
            self.stop()

    @property
    def q(self) -> Array:
        """Measured joint positions `(n,)` [rad]."""
        states = self._world.client.getJointStates(self._world.arm, range(self._world.robot.joint_count))
        return np.array([state[0] for state in states])

    @property
    def tool_pose(self) -> Pose:
        """Pose of the tool centre point in the world, from the measured joint positions."""
        return self.planner.kinematics.forward(self.q)

    @property
    def tool_velocity(self) -> Array:
        """Velocity of the tool centre point in the world `(3,)` [m/s], from the measured joint velocities."""
        states = self._world.client.getJointStates(self._world.arm, range(self._world.robot.joint_count))
        q, turned = np.array([(state[0], state[1] * VELOCITY_INTERVAL) for state in states]).T
        forward = self.planner.kinematics.forward
        return (forward(q + turned).position - forward(q).position) / VELOCITY_INTERVAL

    @property
    def destination(self) -> Array:
        """Where the tool will be when the running motion is over, or is now `(3,)` [m]."""
        return self.planner.kinematics.forward(self._goal).position

    @property
    def at_rest(self) -> bool:
        """True while no motion runs and no braking is under way.

        Raises:
            Fault: The arm has left its commanded path since the last question.
        """
        self._raise_fault()
        return self._motion is None

    @property
    def met(self) -> str | None:
        """What the arm ran into in its last motion, which it then broke off, or None."""
        return self._met

    def plan(self, goal: Goal | str, task: Task = Task()) -> Plan[Trajectory]:
        """Begin to plan a motion from where the arm rests to a goal, or to a named pose of the cell file.

        Raises:
            Fault: The arm is moving, or the cell file has no such pose.
        """
        self._require_rest("plan a motion")
        self._require_pose(goal)
        return self._plans.plan(self._command, goal, task)

    def plan_ahead(self, goal: Goal | str, task: Task = Task()) -> None:
        """Plan a motion, from where the running one will end, before anybody asks for it.

        Raises:
            Fault: The cell file has no such pose.
        """
        self._require_pose(goal)
        if self._braking is None:  # else nobody knows yet where it will end
            self._plans.plan_ahead(self._goal, goal, task)

    def start(self, motion: Motion) -> None:
        """Begin to follow `motion`; the arm must be at rest where it starts.

        Raises:
            Fault: The arm is moving, or is elsewhere, or `motion` was not planned by this arm.
        """
        self._require_rest("start a motion")
        refuse_steps(motion)
        if not isinstance(motion, Trajectory):
            raise Fault(f"the simulated arm follows its own planned motions, not a {type(motion).__name__}")
        self._require_near(motion.start, START_TOLERANCE, "the motion starts")
        self._raise_fault()
        self._motion, self._time, self._met = motion, 0.0, None
        self._contacts.begin()
        self._world.log.motion(motion)

    def stop(self) -> None:
        """Brake along the running motion's path; returns at once, also when nothing runs."""
        if self._motion is not None and self._braking is None:
            self._braking = list(brake(self._motion, self._time, self.planner.limits, STEP))

    def run_into(self, what: str) -> None:
        """Brake as after running into `what`, which `met` then tells; nothing where no motion runs."""
        if self._motion is not None and self._braking is None:
            self._met = what
            self.stop()

    def hold(self) -> None:
        """Send the last command, once more if it was sent."""
        self._world.command_arm(self._command, self._time)

    def advance(self) -> None:
        """Send the command for the coming physics step; called once before each."""
        if self._fault is None and self._braking is None:
            self._require_near(self._command, TRACKING_TOLERANCE, "the command is")
            if self._fault is not None:
                self.stop()
        if self._motion is None:
            return
        if self._braking is None:
            self._met = self._contacts.new(feeling=self._time >= self._motion.guarded)
            if self._met is not None:
                self.stop()
        if self._braking is None:
            self._time += STEP
            done = self._time >= self._motion.duration
        else:
            self._time = self._braking.pop(0)
            done = not self._braking
        self._command = self._motion.at(self._time)[0]
        self.hold()
        if done:
            self._motion, self._braking = None, None
            self._world.log.note(command_log.DONE)

    @property
    def _goal(self) -> Array:
        """Joint positions `(n,)` [rad] at which the running motion ends, or that are commanded."""
        return self._command if self._motion is None else self._motion.end

    def _solve(self, start: Array, goal: Goal | str, task: Task) -> Trajectory:
        return self.planner.plan(start, self._poses[goal] if isinstance(goal, str) else goal, task)

    def _require_pose(self, goal: Goal | str) -> None:
        if isinstance(goal, str) and goal not in self._poses:
            raise Fault(f'the cell file has no arm pose "{goal}"; it has {", ".join(sorted(self._poses))}')

    def _require_near(self, q: Array, tolerance: float, what: str) -> None:
        """Keep a fault in mind if the arm is farther from `q` than `tolerance`."""
        error = np.abs(self.q - q)
        joint = int(np.argmax(error))
        if error[joint] > tolerance:
            self._fault = (
                f"{what} {math.degrees(error[joint]):.2f}° away from where joint {joint + 1} of the arm is; "
                f"{math.degrees(tolerance):.1f}° are allowed"
            )

    def _require_rest(self, wish: str) -> None:
        self._raise_fault()
        if self._motion is not None:
            left = self._motion.duration - self._time
            raise Fault(f"the arm was asked to {wish} while moving ({left:.2f} s to go); wait for `at_rest`")

    def _raise_fault(self) -> None:
        if self._fault is not None:
            fault, self._fault = self._fault, None
            raise Fault(fault)
