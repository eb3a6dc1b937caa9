"""Reconstruction of a simulated world at the interruption of its run, from the command log."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import BPoly

from executive.cell.clock import STEP
from executive.cells.sim import command_log as log
from executive.cells.sim.command_log import Command, states_of
from executive.cells.sim.tool import SuctionTool
from executive.cells.sim.world import World
from executive.geometry import Array, Pose
from executive.motion.state import JointState
from executive.motion.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class InterruptedArm:
    """Motion of the arm at the interruption of a run.

    Attributes:
        command: Joint positions of the last command before the last physics step `(n,)` [rad].
        motion: The motion of the arm, or None.
        time: Time since the start of the motion [s].
        steps: Number of control steps of the run.
        last_command: Control step of the last command to arm or tool; 0 if there was none.
    """

    command: Array
    motion: Trajectory | None
    time: float
    steps: int
    last_command: int


class Rebuilding:
    """Repeats the commands to a recorded world in a new world with the same cell file and seed.

    After each command the new world is bitwise equal to the recorded world after that command.

    Args:
        world: The new world.
        tool: The tool on its arm.
    """

    def __init__(self, world: World, tool: SuctionTool) -> None:
        self._world, self._tool = world, tool
        self._command: Array = np.zeros(0)
        self._motion: Trajectory | None = None
        self._time = 0.0
        self._steps = self._last_command = 0
        self._stepped: tuple[Array, float] | None = None
        """Command before the last physics step, and its time; None if no command followed the step."""

    @property
    def interrupted(self) -> InterruptedArm:
        """Motion of the arm, on whose path it is to brake, as a controller does without new commands.

        If no physics step followed the last command, the previous command is used. Otherwise the arm would
        move by two steps at once, which may tear a load off the cup.
        """
        command, time = self._command, self._time
        if self._stepped and self._motion is not None:
            command, time = self._stepped
        return InterruptedArm(command, self._motion, time, self._steps, self._last_command)

    def do(self, command: Command) -> None:
        """Execute the next command."""
        kind, numbers, _ = command
        if kind in (log.MOTION, log.CLOSE, log.OPEN):
            self._last_command = self._steps
        world, tool = self._world, self._tool
        if kind in (log.STEP, log.IDLE):
            self._steps += kind == log.STEP
            self._stepped = None
            world.step()
            tool.advance()
        elif kind == log.JOINTS_TO:
            if self._command.size:
                self._stepped = self._stepped or (self._command, self._time)
            self._time, self._command = numbers[0], np.array(numbers[1:])
            world.command_arm(self._command, self._time)
        elif kind == log.MOTION:
            duration, guarded, _ = numbers
            self._motion, self._time = join_samples(states_of(command), duration, guarded), 0.0
        elif kind == log.DONE:
            self._motion = None
        elif kind == log.PLACE:
            world.place_object(int(numbers[0]), Pose.of(numbers[1:4], numbers[4:]))
        elif kind == log.REMOVE:
            world.remove_object(int(numbers[0]))
        else:
            {log.CLOSE: tool.close, log.OPEN: tool.open, log.PART: tool.break_seal}[kind]()


def rebuild(world: World, tool: SuctionTool, commands: Iterable[Command]) -> InterruptedArm:
    """Execute all commands in a new world, and return the motion of the arm at the interruption."""
    rebuilding = Rebuilding(world, tool)
    for command in commands:
        rebuilding.do(command)
    return rebuilding.interrupted


class SampledPiece:
    """Quintic spline through given states; implements `MotionPiece`.

    Args:
        states: States at every `STEP` and at the end; each array has the shape `(N, n)`.
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


def join_samples(states: JointState, duration: float, guarded: float = math.inf) -> Trajectory:
    """Return the motion of which `Trajectory.samples` returned these states."""
    return Trajectory([SampledPiece(states, duration)], guarded)
