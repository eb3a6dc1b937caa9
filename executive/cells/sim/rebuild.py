"""Rebuilding a simulated world as it stood when the run that drove it was cut off."""

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
class UnderWay:
    """What the arm was doing when nobody commanded it any more.

    Attributes:
        command: Joint positions of the last command before the last physics step `(n,)` [rad].
        motion: The motion it followed, or None.
        time: How far on that path it was [s].
        steps: Number of control steps of the run.
        last_command: Control step of the last command to arm or tool; 0 if there was none.
    """

    command: Array
    motion: Trajectory | None
    time: float
    steps: int
    last_command: int


class Rebuilding:
    """Does to a world, fresh from the same cell file and seed, one by one what was done to another one.

    After each command the world is to the last bit what the other one was then.

    Args:
        world: The fresh world.
        tool: The tool on its arm.
    """

    def __init__(self, world: World, tool: SuctionTool) -> None:
        self._world, self._tool = world, tool
        self._command: Array = np.zeros(0)
        self._motion: Trajectory | None = None
        self._time = 0.0
        self._steps = self._last_command = 0
        self._stepped: tuple[Array, float] | None = None
        """Command before the last physics step, and its time; None if no command has followed the step."""

    @property
    def under_way(self) -> UnderWay:
        """What the arm was following: as a controller that lost its master, it is to brake on its path.

        If no physics step has followed the last command, the command before it counts: the arm would
        otherwise move by two steps at once, which may tear a load off the cup.
        """
        command, time = self._command, self._time
        if self._stepped and self._motion is not None:
            command, time = self._stepped
        return UnderWay(command, self._motion, time, self._steps, self._last_command)

    def do(self, command: Command) -> None:
        """Do the next command."""
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
            {log.CLOSE: tool.close, log.OPEN: tool.open, log.PART: tool.part}[kind]()


def rebuild(world: World, tool: SuctionTool, commands: Iterable[Command]) -> UnderWay:
    """Do all commands to a fresh world, and return what the arm was following when nobody commanded it."""
    rebuilding = Rebuilding(world, tool)
    for command in commands:
        rebuilding.do(command)
    return rebuilding.under_way


class SampledPiece:
    """A piece between given states: polynomials of fifth degree that agree with them; implements `Piece`.

    Args:
        states: Every `STEP`, and at the end; each array of shape `(N, n)`.
        duration: Time it takes [s].
    """

    def __init__(self, states: JointState, duration: float) -> None:
        self.duration = duration
        self._times = np.append(np.arange(0.0, duration, STEP), duration)
        self._states = states

    def at(self, s: float) -> JointState:
        """Return the state at time `s` [s]."""
        return JointState(*(curve(s) for curve in self._curves))

    def over(self, times: Array) -> JointState:
        """Return the states at `times` `(N,)` [s]."""
        return JointState(*(curve(times) for curve in self._curves))

    @cached_property
    def _curves(self) -> tuple[BPoly, BPoly, BPoly]:
        if len(self._times) == 1:  # a motion to where the arm is: it takes no time
            q = BPoly(self._states.q[None], [0.0, 1.0])
        else:
            q = BPoly.from_derivatives(self._times, np.stack(self._states, axis=1))
        return q, q.derivative(), q.derivative(2)


def join_samples(states: JointState, duration: float, guarded: float = math.inf) -> Trajectory:
    """Return the motion that `Trajectory.samples` gave these states of."""
    return Trajectory([SampledPiece(states, duration)], guarded)
