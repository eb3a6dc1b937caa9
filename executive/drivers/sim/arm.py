"""Driver of the simulated arm: follows planned motions, detects collisions, and brakes along its path."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from executive.cell.arm import Goal, Motion, Task
from executive.cell.config import CellConfig
from executive.cell.protocols import STEP, Clock
from executive.drivers import world_log
from executive.drivers.sim.rebuild import WorldRebuilder
from executive.drivers.sim.world import BODY_B, LINK_A, NORMAL_FORCE, POSITION_A, World, name_load
from executive.errors import Fault
from executive.events import Emit, discard_event
from executive.geometry import Array, format_point
from executive.motion.planner import Planner, PlanningArm
from executive.motion.trajectory import Trajectory, plan_braking, plan_retreat

MIN_CONTACT_FORCE = 2.0
"""Minimum force of a detected contact [N], an assumption for joint torque sensors."""
SEPARATION_STEP_COUNT = 12
"""Number of steps without contact after which two bodies count as separated; a lifted load may bounce."""


class ContactMonitor:
    """Monitor of the contacts of arm, tool and load that begin during the running motion.

    Args:
        world: The world of the arm.
        get_held_body: Returns the body that the tool holds, or None.
    """

    def __init__(self, world: World, get_held_body: Callable[[], int | None]) -> None:
        self._world = world
        self._get_held_body = get_held_body
        self._last_contact_steps: dict[tuple[str, int], int] = {}
        """Physics step of the last contact of each ignored pair of a robot part and a body."""

    def reset(self) -> None:
        """Ignore each pair of bodies that is in contact now until the two bodies separate."""
        step = self._world.step_count
        self._last_contact_steps = {(part, body): step for part, body, _, _ in self._iterate_contacts()}

    def find_new_contact(self, tip_may_touch: bool) -> tuple[str, Sequence[float] | None]:
        """Return description and point [m] of a new forbidden contact; without one, "" and None."""
        now = self._world.step_count
        oldest = now - SEPARATION_STEP_COUNT
        self._last_contact_steps = {k: step for k, step in self._last_contact_steps.items() if step >= oldest}
        for part, body, position, force in self._iterate_contacts():
            if (part, body) in self._last_contact_steps:
                self._last_contact_steps[part, body] = now
            elif force > MIN_CONTACT_FORCE and not (tip_may_touch and self._is_tip(part, position)):
                name = self._world.name_body(body)
                place = format_point(self._world.get_tool_pose().position)
                return f"{part} ran into {name}, with the tool at {place}", position
        return "", None

    def _is_tip(self, part: str, position: Sequence[float]) -> bool:
        """Return True if a point in the world [m] on a part of the robot is on the tip of the tool."""
        X_TW = self._world.get_tool_pose().inverse()
        is_tool = part == self._world.name_link(self._world.tool_index)
        return is_tool and bool(X_TW.apply(position)[2] > -self._world.config.tool.tip_length)

    def _iterate_contacts(self) -> Iterator[tuple[str, int, Sequence[float], float]]:
        """Yield part of the robot, touched body, contact point [m] and normal force [N] of each contact."""
        world = self._world
        held_body = self._get_held_body()
        robot = (world.arm,) if held_body is None else (world.arm, held_body)
        for body in robot:
            for point in world.client.getContactPoints(bodyA=body) or ():
                if point[BODY_B] not in robot:
                    is_arm = body == world.arm
                    part = world.name_link(point[LINK_A]) if is_arm else name_load(world.labels[body])
                    yield part, point[BODY_B], point[POSITION_A], point[NORMAL_FORCE]


DIFFERENTIATION_STEP = 1e-4
"""Time step of the numerical derivative of the tool position [s]."""
START_TOLERANCE = math.radians(0.2)
"""Maximum difference between the position of a joint and its position at the start of a motion [rad]."""
TRACKING_TOLERANCE = math.radians(0.5)
"""Maximum tracking error of a joint [rad]; the error of an undisturbed arm is below 0.001°. A larger error is
the sign of a collision: something holds or pushes the arm."""


class SimArm(PlanningArm[Trajectory]):
    """The arm of a PyBullet world; implements `executive.cell.arm.Arm`.

    Call `advance` before each physics step; it commands the joint positions for the end of that step. After a
    collision, the arm brakes and moves back along its path. A collision is a new contact, or a disturbance
    that pushes the arm off its path.

    Args:
        world: The world of the arm.
        planner: Motion planner of the arm.
        config: The cell file.
        clock: Clock of the run.
        get_held_body: Returns the held body, or None; contacts of this body count as contacts of the arm.
        emit: Receives the events of the arm.
        rebuilder: Rebuilder of the world of an interrupted run; the arm brakes on its motion. None: new run.
    """

    def __init__(
        self,
        world: World,
        planner: Planner,
        config: CellConfig,
        clock: Clock,
        get_held_body: Callable[[], int | None] = lambda: None,
        emit: Emit = discard_event,
        rebuilder: WorldRebuilder | None = None,
    ) -> None:
        super().__init__(config, planner.kinematics, planner.plan, clock, emit)
        self._limits = planner.limits
        self._world = world
        self._contact_monitor = ContactMonitor(world, get_held_body)
        self._motion: Trajectory | None = None
        self._motion_time = 0.0
        self._braking_times: list[float] | None = None
        self._commanded_q = self.q
        # A run may be interrupted before the first joint command is logged.
        if rebuilder is None or not rebuilder.braking_start[0].size:
            self.send_command()
        else:
            self._commanded_q, self._motion_time = rebuilder.braking_start
            self._motion = rebuilder.motion
            self.stop()

    @property
    def q(self) -> Array:
        return self._world.get_joint_positions()

    @property
    def tool_velocity(self) -> Array:
        states = self._world.client.getJointStates(self._world.arm, self._world.joints)
        q, q_change = np.array([(state[0], state[1] * DIFFERENTIATION_STEP) for state in states]).T
        compute_pose = self.kinematics.compute_tool_pose
        return (compute_pose(q + q_change).position - compute_pose(q).position) / DIFFERENTIATION_STEP

    @property
    def at_rest(self) -> bool:
        return self._motion is None

    def plan_ahead(self, goal: Goal | str, task: Task = Task()) -> None:
        """Plan the next motion from the end of the running motion; while the arm brakes, do nothing."""
        if self._braking_times is None:
            super().plan_ahead(goal, task)

    def start(self, motion: Motion) -> None:
        """Begin to follow a motion; if something has pushed the arm off its start, report a collision.

        Raises:
            Fault: The arm is moving, was not sent to the start, or did not plan the motion.
        """
        trajectory = self._require_own_motion(motion, Trajectory)
        if error := _describe_difference(self._commanded_q, trajectory.start, START_TOLERANCE):
            raise Fault(f"the start of the motion is not at the end of the last motion: {error}")
        self.collision = self._describe_disturbance(START_TOLERANCE) or None
        self.contact_point = None
        if self.collision is not None:
            self._commanded_q = self.q
            self.send_command()
            return
        self._motion = trajectory
        self._motion_time = 0.0
        self._contact_monitor.reset()
        self._world.log.append_motion(trajectory)

    def stop(self) -> None:
        if self._motion is not None and self._braking_times is None:
            self._braking_times = list(plan_braking(self._motion, self._motion_time, self._limits))

    def stop_after_collision(self, message: str) -> None:
        """Set `collision` to a message, brake, and move back; do nothing at rest or while the arm brakes."""
        if self._motion is not None and self._braking_times is None:
            self.collision = message
            braking_times = plan_braking(self._motion, self._motion_time, self._limits)
            retreat_times = plan_retreat(self._motion_time, float(braking_times[-1]))
            self._braking_times = [*braking_times.tolist(), *retreat_times.tolist()]

    def send_command(self) -> None:
        """Send the current command to the motors."""
        self._world.command_arm(self._commanded_q, self._motion_time)

    def advance(self) -> None:
        """Check for disturbances and collisions, and send the command for the next physics step."""
        if self._motion is None:
            return
        if self._braking_times is None:
            tip_may_touch = self._motion_time >= self._motion.guarded_start_time
            message, self.contact_point = self._contact_monitor.find_new_contact(tip_may_touch)
            if message := message or self._describe_disturbance(TRACKING_TOLERANCE):
                self.stop_after_collision(message)
        if self._braking_times is None:
            self._motion_time += STEP
            has_ended = self._motion_time >= self._motion.duration
        else:
            self._motion_time = self._braking_times.pop(0)
            has_ended = not self._braking_times
        self._commanded_q = self._motion.state_at(self._motion_time)[0]
        self.send_command()
        if has_ended:
            self._motion = None
            self._braking_times = None
            self._world.log.append(world_log.MOTION_END)

    @property
    def _end_q(self) -> Array:
        return self._commanded_q if self._motion is None else self._motion.end

    def _describe_disturbance(self, tolerance: float) -> str:
        error = _describe_difference(self.q, self._commanded_q, tolerance)
        return f"something holds or pushes the arm off its path: {error}" if error else ""


def _describe_difference(q: Array, expected_q: Array, tolerance: float) -> str:
    """Return a clause if a joint at `q` `(n,)` [rad] is over `tolerance` [rad] away from `expected_q`."""
    errors = np.degrees(np.abs(q - expected_q))
    joint = int(errors.argmax())
    allowed = math.degrees(tolerance)
    if errors[joint] <= allowed:
        return ""
    return f"joint {joint + 1} is {errors[joint]:.2f}° away; {allowed:.1f}° are allowed"
