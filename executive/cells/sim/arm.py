"""Driver of the simulated arm: it follows planned motions step by step and brakes on demand."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from executive.cell.arm import Goal, Motion, Task, reject_generator
from executive.cell.clock import STEP
from executive.cell.config import CellConfig
from executive.cell.protocols import Clock
from executive.cells.sim import command_log
from executive.cells.sim.contacts import Contacts
from executive.cells.sim.rebuild import InterruptedArm
from executive.cells.sim.world import World
from executive.errors import Fault
from executive.events import Emit, discard_event
from executive.geometry import Array, Pose
from executive.motion.braking import plan_braking
from executive.motion.planner import Planner
from executive.motion.plans import Plan, PlanFactory
from executive.motion.trajectory import Trajectory

VELOCITY_INTERVAL = 1e-4
"""Time step of the numerical derivative of the tool position [s]."""
START_TOLERANCE = math.radians(0.2)
"""Largest joint difference between the arm and the start of a motion [rad]."""
TRACKING_TOLERANCE = math.radians(0.5)
"""Largest joint difference between command and arm [rad]; without disturbance it is below 0.001°."""


class SimArm:
    """An arm in a PyBullet world, implementing `executive.cell.arm.Arm`.

    `advance` is called once before every physics step. It commands the joint positions of the motion one
    step later with full position gain and zero velocity, which follows the path to 0.0005°; PyBullet's
    default gain without feed-forward lags by 3°.

    The arm brakes if a disturbance pushes it off its path or if it collides.

    Args:
        world: The world of the arm.
        planner: Motion planner of the arm.
        config: The cell file.
        clock: Clock of the run.
        held: Returns the body at the tool, or None; contacts of this body count as contacts of the arm.
        emit: Receives the events of the arm.
        resumed: Interrupted motion of the arm in a rebuilt world; the arm brakes. None: it is at rest.

    Attributes:
        planner: Motion planner of the arm.
    """

    def __init__(
        self,
        world: World,
        planner: Planner,
        config: CellConfig,
        clock: Clock,
        held: Callable[[], int | None] = lambda: None,
        emit: Emit = discard_event,
        resumed: InterruptedArm | None = None,
    ) -> None:
        self.planner = planner
        self._world = world
        self._poses = {name: np.radians(pose) for name, pose in config.arm.poses_deg.items()}
        self._plans = PlanFactory(self._solve, clock, config.motion.planning_time, emit)
        self._contacts = Contacts(world, held)
        self._motion: Trajectory | None = None
        self._time = 0.0
        self._braking: list[float] | None = None
        self._fault: str | None = None
        self._met: str | None = None
        self._command = self.q
        # The command log may be too short to contain a joint command.
        if resumed is None or not resumed.command.size:
            self.hold()
        else:
            self._command, self._motion, self._time = resumed.command, resumed.motion, resumed.time
            self.stop()

    @property
    def q(self) -> Array:
        """Measured joint positions `(n,)` [rad]."""
        states = self._world.client.getJointStates(self._world.arm, range(self._world.robot.joint_count))
        return np.array([state[0] for state in states])

    @property
    def tool_pose(self) -> Pose:
        """Pose of the tool centre point in the world, from the measured joint positions."""
        return self.planner.kinematics.compute_tool_pose(self.q)

    @property
    def tool_velocity(self) -> Array:
        """Velocity of the tool centre point in the world `(3,)` [m/s], from the measured joint velocities."""
        states = self._world.client.getJointStates(self._world.arm, range(self._world.robot.joint_count))
        q, change = np.array([(state[0], state[1] * VELOCITY_INTERVAL) for state in states]).T
        compute_pose = self.planner.kinematics.compute_tool_pose
        return (compute_pose(q + change).position - compute_pose(q).position) / VELOCITY_INTERVAL

    @property
    def destination(self) -> Array:
        """Position of the tool at the end of the running motion, or now if none runs `(3,)` [m]."""
        return self.planner.kinematics.compute_tool_pose(self._goal).position

    @property
    def at_rest(self) -> bool:
        """True while the arm neither follows a motion nor brakes.

        Raises:
            Fault: The arm has left its commanded path since the last call.
        """
        self._raise_fault()
        return self._motion is None

    @property
    def collision(self) -> str | None:
        """Text of the collision that ended the last motion, or None."""
        return self._met

    def plan(self, goal: Goal | str, task: Task = Task()) -> Plan[Trajectory]:
        """Begin to plan a motion from the current position to a goal, or to a named pose of the cell file.

        Raises:
            Fault: The arm is moving, or the cell file has no such pose.
        """
        self._require_rest("plan a motion")
        self._require_pose(goal)
        return self._plans.plan(self._command, goal, task)

    def plan_ahead(self, goal: Goal | str, task: Task = Task()) -> None:
        """Plan the next motion, from the end of the running motion, in advance.

        Raises:
            Fault: The cell file has no such pose.
        """
        self._require_pose(goal)
        if self._braking is None:  # the end of a braking motion is not known yet
            self._plans.plan_ahead(self._goal, goal, task)

    def start(self, motion: Motion) -> None:
        """Begin to follow `motion`; the arm must be at rest at the start of `motion`.

        Raises:
            Fault: The arm is moving, is not at the start, or did not plan `motion`.
        """
        self._require_rest("start a motion")
        reject_generator(motion)
        if not isinstance(motion, Trajectory):
            raise Fault(f"the simulated arm follows its own planned motions, not a {type(motion).__name__}")
        self._check_distance(motion.start, START_TOLERANCE, "the motion starts")
        self._raise_fault()
        self._motion, self._time, self._met = motion, 0.0, None
        self._contacts.reset()
        self._world.log.motion(motion)

    def stop(self) -> None:
        """Brake along the path of the running motion, if there is one; returns at once."""
        if self._motion is not None and self._braking is None:
            self._braking = list(plan_braking(self._motion, self._time, self.planner.limits, STEP))

    def run_into(self, obstacle: str) -> None:
        """Brake as after a collision, and set `collision` to `obstacle`; does nothing if no motion runs."""
        if self._motion is not None and self._braking is None:
            self._met = obstacle
            self.stop()

    def hold(self) -> None:
        """Send the last command, again if it was sent before."""
        self._world.command_arm(self._command, self._time)

    def advance(self) -> None:
        """Send the command for the coming physics step; called once before each."""
        if self._fault is None and self._braking is None:
            self._check_distance(self._command, TRACKING_TOLERANCE, "the command is")
            if self._fault is not None:
                self.stop()
        if self._motion is None:
            return
        if self._braking is None:
            self._met = self._contacts.find_new(lip_may_touch=self._time >= self._motion.guarded_start_time)
            if self._met is not None:
                self.stop()
        if self._braking is None:
            self._time += STEP
            done = self._time >= self._motion.duration
        else:
            self._time = self._braking.pop(0)
            done = not self._braking
        self._command = self._motion.state_at(self._time)[0]
        self.hold()
        if done:
            self._motion, self._braking = None, None
            self._world.log.note(command_log.DONE)

    @property
    def _goal(self) -> Array:
        """Joint positions at the end of the running motion, or the commanded ones `(n,)` [rad]."""
        return self._command if self._motion is None else self._motion.end

    def _solve(self, start: Array, goal: Goal | str, task: Task) -> Trajectory:
        return self.planner.plan(start, self._poses[goal] if isinstance(goal, str) else goal, task)

    def _require_pose(self, goal: Goal | str) -> None:
        if isinstance(goal, str) and goal not in self._poses:
            raise Fault(f'the cell file has no arm pose "{goal}"; it has {", ".join(sorted(self._poses))}')

    def _check_distance(self, q: Array, tolerance: float, text: str) -> None:
        """Record a fault, to be raised later, if a joint is farther from `q` than `tolerance` [rad]."""
        error = np.abs(self.q - q)
        joint = int(np.argmax(error))
        if error[joint] > tolerance:
            self._fault = (
                f"{text} {math.degrees(error[joint]):.2f}° away from where joint {joint + 1} of the arm is; "
                f"{math.degrees(tolerance):.1f}° are allowed"
            )

    def _require_rest(self, order: str) -> None:
        self._raise_fault()
        if self._motion is not None:
            left = self._motion.duration - self._time
            raise Fault(f"the arm was asked to {order} while moving ({left:.2f} s to go); wait for `at_rest`")

    def _raise_fault(self) -> None:
        if self._fault is not None:
            fault, self._fault = self._fault, None
            raise Fault(fault)
