"""The simulated arm's driver: follows planned motions step by step and brakes on demand."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence

import numpy as np
import pybullet

from executive.cell import Motion, Via
from executive.cell_config import ArmConfig
from executive.errors import Blocked, Fault, Unreachable
from executive.geometry import Array, Pose
from executive.messages import ObjectClass
from executive.motion.limits import JointLimits
from executive.motion.planner import Planner
from executive.motion.stop import brake
from executive.motion.strokes import UPRIGHT
from executive.motion.trajectory import JOINTS, Trajectory
from executive.sim.world import STEP, World

TORQUES = (320.0, 320.0, 176.0, 176.0, 110.0, 40.0, 40.0)
"""Largest joint torques of the iiwa 14 [Nm], data sheet as in RobotLocomotion/models iiwa_description."""
START_TOLERANCE = math.radians(0.2)
"""Largest joint difference between the arm and the start of a motion [rad]."""
LIFTS = (0.0, 0.05, 0.10)
"""Heights above travel height that are tried before leaving for a named pose, in order [m]."""
TRACKING_TOLERANCE = math.radians(0.5)
"""Largest joint difference between command and arm [rad]; undisturbed it is under 0.001°."""


class SimArm:
    """An arm in a PyBullet world, implementing `cell.Arm`.

    `advance` is called once before every physics step. It commands where the motion is one step later
    with full position gain and no velocity, which follows the path to 0.0005°; PyBullet's default gain
    without feed-forward lags by 3°.

    Attributes:
        planner: Plans its motions.
    """

    def __init__(
        self,
        world: World,
        planner: Planner,
        limits: JointLimits,
        config: ArmConfig,
        travel_height: float = 0.0,
    ) -> None:
        """Take over the arm of `world` where it is.

        `travel_height` [m]: the tool goes straight up to it before it leaves for a named pose.
        """
        self.planner = planner
        self._world = world
        self._limits = limits
        self._poses = {name: np.radians(pose) for name, pose in config.poses_deg.items()}
        self._travel_height = travel_height
        self._motion: Trajectory | None = None
        self._time = 0.0
        self._braking: list[float] | None = None
        self._fault: str | None = None
        self._command = self.q
        self._send()

    @property
    def q(self) -> Array:
        """Measured joint positions `(7,)` [rad]."""
        states = self._world.client.getJointStates(self._world.arm, range(JOINTS))
        return np.array([state[0] for state in states])

    @property
    def tool_pose(self) -> Pose:
        """Pose of the tool centre point in the world, from the measured joint positions."""
        return self.planner.kinematics.forward(self.q)

    @property
    def at_rest(self) -> bool:
        """True while no motion runs and no braking is under way.

        Raises:
            Fault: The arm has left its commanded path since the last question.
        """
        self._raise_fault()
        return self._motion is None

    def plan(self, vias: Sequence[Via], carrying: ObjectClass | None = None) -> Trajectory:
        """Return a motion from where the arm rests through every via.

        Raises:
            Unreachable: A via has no joint solution inside the limits.
            Blocked: The way comes too close to something.
            Fault: The arm is moving.
        """
        self._require_rest("plan a motion")
        return self.planner.plan(self._command, vias, carrying)

    def plan_to_pose(self, name: str) -> Trajectory:
        """Return a motion to the named joint pose of the cell file; raises as `plan` does."""
        self._require_rest("plan a motion")
        if name not in self._poses:
            raise Fault(f'the cell file has no arm pose "{name}"; it has {", ".join(sorted(self._poses))}')
        goal = self._poses[name]
        X_WT = self.planner.kinematics.forward(self._command)
        x, y, z = X_WT.position
        if z < self._travel_height and -X_WT.rotation[2, 2] > UPRIGHT:
            there = self.planner.kinematics.forward(goal).position
            lifts = [Via(np.array([x, y, self._travel_height + higher])) for higher in LIFTS]
            # Straight from above to the pose, or from a contorted posture first to where its tool is: there
            # the planner may choose the posture.
            for first in (*([lift] for lift in lifts), *([lift, Via(there)] for lift in lifts)):
                with contextlib.suppress(Unreachable, Blocked):
                    return self.planner.plan_joints(self._command, goal, first=first)
        return self.planner.plan_joints(self._command, goal)

    def start(self, motion: Motion) -> None:
        """Begin to follow `motion`; the arm must be at rest where it starts.

        Raises:
            Fault: The arm is moving, or is elsewhere, or `motion` was not planned by this arm.
        """
        self._require_rest("start a motion")
        if not isinstance(motion, Trajectory):
            raise Fault(f"the simulated arm follows its own planned motions, not a {type(motion).__name__}")
        self._require_near(motion.start, START_TOLERANCE, "the motion starts")
        self._raise_fault()
        self._motion, self._time = motion, 0.0

    def stop(self) -> None:
        """Brake along the running motion's path; returns at once, also when nothing runs."""
        if self._motion is not None and self._braking is None:
            self._braking = list(brake(self._motion, self._time, self._limits, STEP))

    def advance(self) -> None:
        """Send the command for the coming physics step; called once before each."""
        if self._fault is None and self._braking is None:
            self._require_near(self._command, TRACKING_TOLERANCE, "the command is")
            if self._fault is not None:
                self.stop()
        if self._motion is None:
            return
        if self._braking is None:
            self._time += STEP
            done = self._time >= self._motion.duration
        else:
            self._time = self._braking.pop(0)
            done = not self._braking
        self._command = self._motion.at(self._time)[0]
        if done:
            self._motion, self._braking = None, None
        self._send()

    def _send(self) -> None:
        self._world.client.setJointMotorControlArray(
            self._world.arm,
            range(JOINTS),
            pybullet.POSITION_CONTROL,
            targetPositions=self._command.tolist(),
            forces=TORQUES,
            positionGains=[1.0] * JOINTS,
        )

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
