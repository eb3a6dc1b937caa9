"""Driver of the simulated arm: follows planned motions, detects collisions, and brakes along its path."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from executive.cell.arm import Motion, MotionGuard
from executive.cell.device_config import STEP
from executive.drivers import world_log
from executive.drivers.sim.tool import SimTool
from executive.drivers.sim.world import World
from executive.errors import Fault
from executive.geometry import Array, format_point
from executive.motion.joints import JointLimits
from executive.motion.trajectory import Trajectory, plan_braking, plan_retreat
from executive.physics.cell_world import BODY_B, LINK_A, NORMAL_FORCE, POSITION_A, name_load

MIN_CONTACT_FORCE = 2.0
"""Minimum force of a detected contact [N], an assumption for joint torque sensors."""
SEPARATION_STEP_COUNT = 12
"""Number of steps without contact after which two bodies count as separated; a lifted load may bounce."""


class ContactMonitor:
    """Monitor of the contacts of arm, tool and load that begin during the running motion.

    Args:
        world: The world of the arm.
        tool: The tool, which may hold a body.

    Attributes:
        is_load_touching: True if `find_new_contact` has found a permitted contact of the load.
    """

    def __init__(self, world: World, tool: SimTool) -> None:
        self._world = world
        self._tool = tool
        self.is_load_touching = False
        self._last_contact_steps: dict[tuple[str, int], int] = {}
        """Physics step of the last contact of each ignored pair of a robot part and a body."""

    def reset(self) -> None:
        """Ignore each pair of bodies that is in contact now until the two bodies separate."""
        step = self._world.step_count
        self._last_contact_steps = {(part, body): step for part, body, _, _ in self._iterate_contacts()}

    def find_new_contact(self, guard: MotionGuard) -> tuple[str, Sequence[float] | None]:
        """Return description and point [m] of a new contact that `guard` forbids; if none, "" and None."""
        self.is_load_touching = False
        now = self._world.step_count
        oldest = now - SEPARATION_STEP_COUNT
        self._last_contact_steps = {k: step for k, step in self._last_contact_steps.items() if step >= oldest}
        for part, body, position, force in self._iterate_contacts():
            if (part, body) in self._last_contact_steps:
                self._last_contact_steps[part, body] = now
            elif force > MIN_CONTACT_FORCE and guard.touch and part == name_load("object"):
                self.is_load_touching = True
            elif force > MIN_CONTACT_FORCE and not self._is_permitted(guard, part, position, force):
                name = self._world.name_body(body)
                place = format_point(self._world.get_tool_pose().position)
                return f"{part} ran into {name}, with the tool at {place}", position
        return "", None

    def _is_permitted(self, guard: MotionGuard, part: str, position: Sequence[float], force: float) -> bool:
        """Return True if a guard permits a force [N] on a part of the robot at a point in the world [m]."""
        if part != self._world.name_link(self._world.tool_index):
            return False
        X_TW = self._world.get_tool_pose().inverse()
        is_tip = bool(X_TW.apply(position)[2] > -self._world.config.tool.tip_length)
        return (guard.touch and is_tip) or force <= guard.push_force

    def _iterate_contacts(self) -> Iterator[tuple[str, int, Sequence[float], float]]:
        """Yield part of the robot, touched body, contact point [m] and normal force [N] of each contact."""
        world = self._world
        held_body = self._tool.held_body
        robot = (world.arm,) if held_body is None else (world.arm, held_body)
        for body in robot:
            for point in world.client.getContactPoints(bodyA=body) or ():
                if point[BODY_B] not in robot:
                    is_arm = body == world.arm
                    part = world.name_link(point[LINK_A]) if is_arm else name_load("object")
                    yield part, point[BODY_B], point[POSITION_A], point[NORMAL_FORCE]


START_TOLERANCE = math.radians(0.2)
"""Maximum difference between the position of a joint and its position at the start of a motion [rad]."""
TRACKING_TOLERANCE = math.radians(0.5)
"""Maximum tracking error of a joint [rad]; the error of an undisturbed arm is below 0.001°. A larger error is
the sign of a collision: something holds or pushes the arm."""


class SimArm:
    """The arm of a PyBullet world; implements `executive.cell.devices.ArmDevice`.

    Call `advance` before each physics step; it commands the joint positions for the end of that step. After a
    collision, the arm brakes and moves back along its path. A collision is a new contact, or a disturbance
    that pushes the arm off its path.

    Args:
        world: The world of the arm.
        tool: The tool, whose sensors trigger guards. Contacts of the body that it holds count as contacts of
            the arm.
        limits: Limits of the joints.

    Attributes:
        at_rest: True while the arm neither follows a motion nor brakes.
        commanded_q: Commanded joint positions `(n,)` [rad] for the end of the next physics step.
        motion: The motion that the arm follows or brakes on, or None.
        motion_time: Time in the motion [s].
        collision: Description of the collision that ended the last motion, or None.
        contact_point: Point of the collision in the world `(x, y, z)` [m]; None: unknown, or no collision.
    """

    def __init__(self, world: World, tool: SimTool, limits: JointLimits) -> None:
        self.at_rest = True
        self.collision: str | None = None
        self.contact_point: Sequence[float] | None = None
        self._world = world
        self._tool = tool
        self._limits = limits
        self._contact_monitor = ContactMonitor(world, tool)
        self.motion: Trajectory | None = None
        self.motion_time = 0.0
        self._guard = MotionGuard()
        self._has_been_free = False
        """True if the tool has touched nothing at some time since the start of the motion."""
        self._braking_times: list[float] | None = None
        self.commanded_q = self.q
        self.send_command()

    @property
    def q(self) -> Array:
        return self._world.get_joint_positions()

    @property
    def qd(self) -> Array:
        states = self._world.client.getJointStates(self._world.arm, self._world.joints)
        return np.array([state[1] for state in states])

    @property
    def end_q(self) -> Array:
        return self.commanded_q if self.motion is None else self.motion.end

    def execute(self, motion: Motion, guard: MotionGuard) -> None:
        """Begin to follow a motion; if something has pushed the arm off its start, report a collision."""
        if not self.at_rest:
            raise Fault("the arm cannot start a motion while moving; wait for `at_rest`")
        if not isinstance(motion, Trajectory):
            raise Fault(f"the simulated arm follows trajectories, not a {type(motion).__name__}")
        if error := _describe_difference(self.commanded_q, motion.start, START_TOLERANCE):
            raise Fault(f"the start of the motion is not at the end of the last motion: {error}")
        self.collision = self._describe_disturbance(START_TOLERANCE) or None
        self.contact_point = None
        if self.collision is not None:
            self.commanded_q = self.q
            self.send_command()
            return
        self.motion = motion
        self.motion_time = 0.0
        self._guard = guard
        self._has_been_free = not (guard.touch and self._tool.touching)
        self.at_rest = False
        self._contact_monitor.reset()
        self._world.log_command(world_log.MOTION, *world_log.encode_motion(motion))

    def stop(self) -> None:
        if self.motion is not None and self._braking_times is None:
            self._braking_times = list(plan_braking(self.motion, self.motion_time, self._limits))

    def stop_after_collision(self, message: str) -> None:
        """Set `collision` to a message, brake, and move back; do nothing at rest or while the arm brakes."""
        if self.motion is not None and self._braking_times is None:
            self.collision = message
            braking_times = plan_braking(self.motion, self.motion_time, self._limits)
            retreat_times = plan_retreat(self.motion_time, float(braking_times[-1]))
            self._braking_times = [*braking_times.tolist(), *retreat_times.tolist()]

    def resume_braking(self, motion: Trajectory | None, commanded_q: Array, motion_time: float) -> None:
        """Brake on the interrupted motion of a rebuilt world, from its last command `(n,)` [rad]."""
        self.commanded_q = commanded_q
        self.motion_time = motion_time
        self.motion = motion
        self.at_rest = motion is None
        self.stop()

    def send_command(self) -> None:
        """Send the current command to the motors."""
        self._world.command_arm(self.commanded_q, self.motion_time)

    def advance(self) -> None:
        """Check guards, collisions and disturbances, and send the command for the next physics step."""
        motion = self.motion
        if motion is None:
            return
        if self._braking_times is None:
            self._check_guard()
        if self._braking_times is None:
            guard = self._guard if self.motion_time >= motion.guarded_start_time else MotionGuard()
            message, self.contact_point = self._contact_monitor.find_new_contact(guard)
            if not message and np.abs(self.q - self.commanded_q).max() > TRACKING_TOLERANCE:
                message = self._describe_disturbance(TRACKING_TOLERANCE)
            if message:
                self.stop_after_collision(message)
            elif self._contact_monitor.is_load_touching:
                self.stop()
        if self._braking_times is None:
            self.motion_time += STEP
            has_ended = self.motion_time >= motion.duration
        else:
            self.motion_time = self._braking_times.pop(0)
            has_ended = not self._braking_times
        self.commanded_q = motion.state_at(self.motion_time).q
        self.send_command()
        if has_ended:
            self.motion = None
            self._braking_times = None
            self.at_rest = True
            self._world.log_command(world_log.MOTION_END)

    def _check_guard(self) -> None:
        """Begin to brake at an event of the guard."""
        if self._guard.lost_grip and not self._tool.holding:
            self.stop()
        elif self._guard.touch and self._tool.held_body is None:
            is_touching = self._tool.touching
            if self._has_been_free and is_touching:
                self.stop()
            self._has_been_free |= not is_touching

    def _describe_disturbance(self, tolerance: float) -> str:
        error = _describe_difference(self.q, self.commanded_q, tolerance)
        return f"something holds or pushes the arm off its path: {error}" if error else ""


def _describe_difference(q: Array, expected_q: Array, tolerance: float) -> str:
    """Return a clause if a joint at `q` `(n,)` [rad] is over `tolerance` [rad] away from `expected_q`."""
    errors = np.degrees(np.abs(q - expected_q))
    joint = int(errors.argmax())
    allowed = math.degrees(tolerance)
    if errors[joint] <= allowed:
        return ""
    return f"joint {joint + 1} is {errors[joint]:.2f}° away; {allowed:.1f}° are allowed"
