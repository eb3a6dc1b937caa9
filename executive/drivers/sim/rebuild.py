"""Reconstruction of the simulated world of an interrupted run from its command log."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from executive.cell.arm import JointState
from executive.cell.device_config import STEP
from executive.drivers import world_log
from executive.drivers.sim.tool import SimTool
from executive.drivers.sim.world import World
from executive.drivers.world_log import Command
from executive.errors import InputError
from executive.geometry import Array, Pose
from executive.motion.trajectory import Trajectory


class WorldRebuilder:
    """Executes recorded commands in a new world with the cell file and the seed of the recorded world.

    After each physics step, the new world is bitwise equal to the recorded world at the same time.

    Args:
        world: The new world.
        tool: Tool of the new world.

    Attributes:
        motion: Motion of the arm, or None if the arm is at rest.
        braking_start: Joint targets of the last physics step `(n,)` [rad], empty before the first step, and
            their time since the start of the motion [s]; the arm brakes from there.
        step_count: Number of physics steps of the run.
        last_command_step: Number of physics steps of the run before the last command to arm or tool; 0: none.
        image_count: Number of captured images.
    """

    def __init__(self, world: World, tool: SimTool) -> None:
        self.motion: Trajectory | None = None
        self.braking_start: tuple[Array, float] = (np.zeros(0), 0.0)
        self.step_count = 0
        self.last_command_step = 0
        self.image_count = 0
        self._world = world
        self._tool = tool

    def execute(self, command: Command) -> None:
        """Execute the next command.

        Raises:
            InputError: The command is invalid.
        """
        kind, arguments = command
        if kind in (world_log.MOTION, world_log.CLOSE, world_log.OPEN):
            self.last_command_step = self.step_count
        try:
            if kind == world_log.MOTION:
                self._start_motion(*arguments)
            else:
                self._execute(kind, np.array(arguments, dtype=float))
        except Exception as error:
            # A changed log may contain anything, for example a body that does not exist.
            raise InputError(
                f'the log of the world is damaged: its command "{kind}" cannot be executed: {error}; '
                "restore a copy of it, or run the mission again"
            ) from error

    def _start_motion(self, duration: float, samples: str) -> None:
        states = np.frombuffer(base64.b64decode(samples), "<f8").reshape(3, -1, len(self._world.joints))
        self.motion = Trajectory([SampledMotion(JointState(*states), duration)]) if duration else None
        self.braking_start = (self.braking_start[0], 0.0)

    def _execute(self, kind: str, numbers: Array) -> None:
        if not np.isfinite(numbers).all():
            raise ValueError("a number is infinite")
        world = self._world
        tool = self._tool
        if kind in (world_log.RUN_STEP, world_log.IDLE_STEP):
            if kind == world_log.RUN_STEP:
                self.step_count += 1
            if numbers.size:
                self.braking_start = (numbers[1:], float(numbers[0]))
            if self.braking_start[0].size:
                world.command_arm(*self.braking_start)
            world.step()
            tool.advance()
        elif kind == world_log.CAPTURE:
            self.image_count += 1
        elif kind == world_log.MOTION_END:
            self.motion = None
        elif kind == world_log.SET_POSE:
            world.place_object(int(numbers[0]), Pose.of(numbers[1:4], numbers[4:]))
        elif kind == world_log.REMOVE:
            world.remove_object(int(numbers[0]))
        else:
            actions = {
                world_log.CLOSE: tool.close,
                world_log.OPEN: tool.open,
                world_log.GRIP_LOST: tool.lose_grip,
            }
            actions[kind]()


class SampledMotion:
    """Quintic spline through the samples of a motion; implements `executive.motion.trajectory.MotionPiece`.

    Args:
        states: States at multiples of `STEP` and at the end; each array has the shape `(N, n)`.
        duration: Duration of the motion, not 0 [s].
    """

    def __init__(self, states: JointState, duration: float) -> None:
        # scipy.interpolate is imported here because the import takes 0.5 s, and only resumed runs need it.
        from scipy.interpolate import BPoly

        self.duration = duration
        motion_times = np.append(np.arange(0.0, duration, STEP), duration)
        q = BPoly.from_derivatives(motion_times, np.stack(states, axis=1))
        self._curves = (q, q.derivative(), q.derivative(2))

    def state_at(self, s: Any) -> JointState:
        """Return the state at the time `s` since the start of the motion [s], or at each of several times."""
        return JointState(*(curve(s) for curve in self._curves))

    sample = state_at
