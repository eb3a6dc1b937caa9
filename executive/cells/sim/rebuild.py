"""Reconstruction of the simulated world of an interrupted run from its command log."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import BPoly

from executive.cell.clock import STEP
from executive.cells.sim import command_log as log
from executive.cells.sim.command_log import Command, to_joint_states
from executive.cells.sim.tool import SuctionTool
from executive.cells.sim.world import World
from executive.geometry import Array, Pose
from executive.motion.state import JointState
from executive.motion.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class InterruptedArm:
    """Motion of the arm at the interruption of a run.

    Attributes:
        command: Commanded joint positions from which the arm brakes `(n,)` [rad]; empty without a command.
        motion: Interrupted motion of the arm, or None if the arm was at rest.
        time: Time of `command`, since the start of the motion [s].
        steps: Number of control steps of the run.
        last_command: Control step of the last command to arm or tool; 0 if there was none.
    """

    command: Array
    motion: Trajectory | None
    time: float
    steps: int
    last_command: int


class WorldRebuilder:
    """Executes recorded commands in a new world with the cell file and the seed of the recorded world.

    After each command the new world is bitwise equal to the recorded world after that command.

    Args:
        world: The new world.
        tool: Tool of the new world.
    """

    def __init__(self, world: World, tool: SuctionTool) -> None:
        self._world, self._tool = world, tool
        self._command: Array = np.zeros(0)
        self._motion: Trajectory | None = None
        self._time = 0.0
        self._steps = self._last_command = 0
        self._applied_command: tuple[Array, float] | None = None
        """Command of the last physics step, and its time; None if no command followed the step."""

    @property
    def interrupted_arm(self) -> InterruptedArm:
        """Motion of the arm, along which the arm brakes after the interruption.

        If no physics step followed the last command, the command before it is used. Otherwise the arm would
        move by two steps at once, which may tear a load off the cup.
        """
        command, time = self._command, self._time
        if self._applied_command and self._motion is not None:
            command, time = self._applied_command
        return InterruptedArm(command, self._motion, time, self._steps, self._last_command)

    def execute(self, command: Command) -> None:
        """Execute the next command."""
        kind, numbers, _ = command
        if kind in (log.MOTION, log.VACUUM_ON, log.VACUUM_OFF):
            self._last_command = self._steps
        world, tool = self._world, self._tool
        if kind in (log.RUN_STEP, log.IDLE_STEP):
            self._steps += kind == log.RUN_STEP
            self._applied_command = None
            world.step()
            tool.advance()
        elif kind == log.JOINT_TARGETS:
            if self._command.size:
                self._applied_command = self._applied_command or (self._command, self._time)
            self._time, self._command = numbers[0], np.array(numbers[1:])
            world.command_arm(self._command, self._time)
        elif kind == log.MOTION:
            duration, guarded_start_time, _ = numbers
            self._motion = to_trajectory(to_joint_states(command), duration, guarded_start_time)
            self._time = 0.0
        elif kind == log.MOTION_END:
            self._motion = None
        elif kind == log.SET_POSE:
            world.place_object(int(numbers[0]), Pose.of(numbers[1:4], numbers[4:]))
        elif kind == log.REMOVE:
            world.remove_object(int(numbers[0]))
        else:
            {log.VACUUM_ON: tool.close, log.VACUUM_OFF: tool.open, log.SEAL_BREAK: tool.break_seal}[kind]()


def rebuild_world(world: World, tool: SuctionTool, commands: Iterable[Command]) -> InterruptedArm:
    """Execute all commands in a new world, and return the motion of the arm at the interruption."""
    rebuilder = WorldRebuilder(world, tool)
    for command in commands:
        rebuilder.execute(command)
    return rebuilder.interrupted_arm


class SampledPiece:
    """Quintic spline through sampled states; implements `executive.motion.state.MotionPiece`.

    Args:
        states: States at multiples of `STEP` and at the end; each array has the shape `(N, n)`.
        duration: Duration of the piece [s].
    """

    def __init__(self, states: JointState, duration: float) -> None:
        self.duration = duration
        self._times = np.append(np.arange(0.0, duration, STEP), duration)
        self._states = states

    def state_at(self, s: float) -> JointState:
        """Return the state at time `s` [s]."""
        return JointState(*(curve(s) for curve in self._curves))

    def sample(self, times: Array) -> JointState:
        """Return the states at `times` `(N,)` [s]."""
        return JointState(*(curve(times) for curve in self._curves))

    @cached_property
    def _curves(self) -> tuple[BPoly, BPoly, BPoly]:
        if len(self._times) == 1:  # a motion of duration 0
            q = BPoly(self._states.q[None], [0.0, 1.0])
        else:
            q = BPoly.from_derivatives(self._times, np.stack(self._states, axis=1))
        return q, q.derivative(), q.derivative(2)


def to_trajectory(states: JointState, duration: float, guarded_start_time: float = math.inf) -> Trajectory:
    """Return the trajectory through `states`, which are the `samples` of the original trajectory."""
    return Trajectory([SampledPiece(states, duration)], guarded_start_time)
