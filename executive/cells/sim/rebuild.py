"""Reconstruction of the simulated world of an interrupted run from its command log."""

from __future__ import annotations

import numpy as np

from executive.cell.clock import STEP
from executive.cells.sim import command_log
from executive.cells.sim.command_log import Command
from executive.cells.sim.tool import SuctionTool
from executive.cells.sim.world import World
from executive.geometry import Array, Pose
from executive.motion.joints import JointState
from executive.motion.trajectory import Trajectory


class WorldRebuilder:
    """Executes recorded commands in a new world with the cell file and the seed of the recorded world.

    After each command, the new world is bitwise equal to the recorded world at the same time.

    Args:
        world: The new world.
        tool: Tool of the new world.

    Attributes:
        motion: Motion of the arm, or None if the arm is at rest.
        step_count: Number of control steps of the run.
        last_command_step: Number of control steps before the last motion or vacuum command; 0: no command.
    """

    def __init__(self, world: World, tool: SuctionTool) -> None:
        self.motion: Trajectory | None = None
        self.step_count = self.last_command_step = 0
        self._world, self._tool = world, tool
        self._joint_targets: Array = np.zeros(0)
        self._motion_time = 0.0
        self._applied_targets: tuple[Array, float] | None = None
        """Joint targets and motion time of the last physics step, if newer targets followed it; else None."""

    @property
    def braking_start(self) -> tuple[Array, float]:
        """Joint positions from which the arm brakes `(n,)` [rad], empty without a command; their time [s].

        The time counts from the start of the motion.
        """
        # If the arm started from joint targets that no physics step has used, the arm would move by two steps
        # at once, which may tear a load off the cup.
        if self._applied_targets and self.motion is not None:
            return self._applied_targets
        return self._joint_targets, self._motion_time

    def execute(self, command: Command) -> None:
        """Execute the next command."""
        kind, numbers, states, _ = command
        if kind in (command_log.MOTION, command_log.VACUUM_ON, command_log.VACUUM_OFF):
            self.last_command_step = self.step_count
        world, tool = self._world, self._tool
        if kind in (command_log.RUN_STEP, command_log.IDLE_STEP):
            self.step_count += kind == command_log.RUN_STEP
            self._applied_targets = None
            world.step()
            tool.advance()
        elif kind == command_log.JOINT_TARGETS:
            if self._joint_targets.size:
                self._applied_targets = self._applied_targets or (self._joint_targets, self._motion_time)
            self._motion_time, self._joint_targets = numbers[0], np.array(numbers[1:])
            world.command_arm(self._joint_targets, self._motion_time)
        elif kind == command_log.MOTION:
            assert states is not None
            duration, guarded_start_time, _ = numbers
            self.motion = Trajectory([SampledMotion(states, duration)], guarded_start_time)
            self._motion_time = 0.0
        elif kind == command_log.MOTION_END:
            self.motion = None
        elif kind == command_log.SET_POSE:
            world.place_object(int(numbers[0]), Pose.of(numbers[1:4], numbers[4:]))
        elif kind == command_log.REMOVE:
            world.remove_object(int(numbers[0]))
        else:
            actions = {command_log.VACUUM_ON: tool.close, command_log.VACUUM_OFF: tool.open}
            actions.get(kind, tool.break_seal)()


class SampledMotion:
    """Quintic spline through the samples of a motion; implements `executive.motion.trajectory.MotionPiece`.

    Args:
        states: States at multiples of `STEP` and at the end; each array has the shape `(N, n)`.
        duration: Duration of the motion [s].
    """

    def __init__(self, states: JointState, duration: float) -> None:
        # scipy.interpolate is imported here because the import takes 0.5 s, and only resumed runs need it.
        from scipy.interpolate import BPoly

        self.duration = duration
        motion_times = np.append(np.arange(0.0, duration, STEP), duration)
        if len(motion_times) == 1:  # a motion of duration 0
            q = BPoly(states.q[None], [0.0, 1.0])
        else:
            q = BPoly.from_derivatives(motion_times, np.stack(states, axis=1))
        self._curves = q, q.derivative(), q.derivative(2)

    def state_at(self, s: float) -> JointState:
        """Return the state at the time `s` since the start of the motion [s]."""
        return JointState(*(curve(s) for curve in self._curves))

    def sample(self, times: Array) -> JointState:
        """Return the states at `times` `(N,)` [s]."""
        return JointState(*(curve(times) for curve in self._curves))
