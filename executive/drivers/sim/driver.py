"""Driver of the simulated cell: arm, tool and camera in a PyBullet world."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from executive.cell.arm import JointState
from executive.cell.config import CellConfig
from executive.cell.device_config import STEP
from executive.cell.devices import DEFAULT_ROLE, DriverOptions, StepClock, TrueObject, derive_seeds
from executive.cell.objects import BIN_THICKNESS
from executive.drivers import world_log
from executive.drivers.sim.arm import SimArm
from executive.drivers.sim.camera import SimCamera, find_missing_depth_sensors
from executive.drivers.sim.model_check import find_model_errors, measure_hold
from executive.drivers.sim.models import compute_mass
from executive.drivers.sim.spawn import build_world_of_run, find_object_count_errors
from executive.drivers.sim.tool import SimTool
from executive.drivers.sim.world import SimVisuals, World
from executive.drivers.world_log import Command, CommandLog, read_commands
from executive.errors import InputError
from executive.geometry import Array, Pose
from executive.motion.joints import JointLimits
from executive.motion.trajectory import Trajectory
from executive.text.validate import KeyPath

MAX_RATIO_ERROR = 1e-3
"""Maximum relative difference between the step of the clock and a multiple of the physics step."""
MIN_CENTRE_HEIGHT = -0.05
"""Minimum height of the centre of an object that is still on the table [m]."""


class SimDriver:
    """The devices of a simulated cell; implements `executive.cell.devices.Driver` and its capabilities.

    Args:
        config: The cell file.
        options: Seed and options of the driver.
        make_camera: Makes the camera from the arguments of `SimCamera`.

    Attributes:
        world: The PyBullet world.
        clock: Clock of the world.
        arm, tool, camera: The devices.
        last_command_tick: Tick of the last start of a motion or command to the tool before a resumption.

    Raises:
        InputError: The simulated cell does not support the cell file, or the scene file is invalid.
    """

    compute_mass = staticmethod(compute_mass)
    measure_hold = staticmethod(measure_hold)
    driver_options: ClassVar[Mapping[str, str]] = {"scene": "file", "gui": "flag"}

    def __init__(
        self, config: CellConfig, options: DriverOptions, make_camera: Callable[..., SimCamera] = SimCamera
    ) -> None:
        for _, message in find_missing_depth_sensors(config):
            raise InputError(f"cell {config.cell}: {message}")
        _, camera_seed, _, load_seed = derive_seeds(options.seed)
        self.world, scene = build_world_of_run(config, options.seed, options.values)
        self._steps_per_tick = round(config.clock.step / STEP)
        self.clock = StepClock(self._steps_per_tick * STEP)
        self.clock.on_tick = self._advance
        self.tool: SimTool = config.tool.build_sim(self.world, load_seed)
        self.arm = SimArm(self.world, self.tool, JointLimits.from_config(config.arm.limits))
        self.camera = make_camera(self.world, config, self.clock, camera_seed, scene.light)
        self.arms = {DEFAULT_ROLE: self.arm}
        self.tools = {DEFAULT_ROLE: self.tool}
        self.cameras = dict.fromkeys(config.cameras, self.camera)
        self.last_command_tick = 0
        # The audit relies on the true bins of the scene, not on the cell file.
        self._bins = self.world.config.build_bins()

    @staticmethod
    def check(config: CellConfig, cell_folder: Path) -> Iterable[tuple[KeyPath, str]]:
        """Yield key and message of each error about models, objects, depth sensors and the clock."""
        del cell_folder
        ratio = config.clock.step / STEP
        if abs(ratio - round(ratio)) > MAX_RATIO_ERROR * ratio:
            steps = " or ".join(f"{count}/240 = {count * STEP:.6f}" for count in (int(ratio), int(ratio) + 1))
            message = f"the step of a simulated cell is a multiple of 1/240 s, such as {steps} s"
            yield ("clock", "step"), message
        yield from find_model_errors(config)
        yield from find_missing_depth_sensors(config)
        yield from find_object_count_errors(config)

    def _advance(self) -> None:
        """Execute the physics steps of one tick."""
        for _ in range(self._steps_per_tick):
            self._step()

    def _step(self) -> None:
        if not self.arm.at_rest:
            self.arm.advance()
        self.world.step()
        if not self.tool.is_idle:
            self.tool.advance()

    def log_to(self, path: Path) -> None:
        self.world.log = CommandLog(path)
        self.arm.send_command()

    def rebuild(self, path: Path) -> int:
        rebuilder = WorldRebuilder(self.world, self.tool)
        for command in read_commands(path):
            rebuilder.execute(command)
        self.world.log = CommandLog(path, resume=True)
        self.camera.image_count = rebuilder.image_count
        self.last_command_tick = rebuilder.last_command_step // self._steps_per_tick
        # A run may be interrupted before the first joint command is logged.
        if rebuilder.braking_start[0].size:
            self.arm.resume_braking(rebuilder.motion, *rebuilder.braking_start)
        else:
            self.arm.send_command()
        # A killed process may have executed a part of the physics steps of its last tick.
        for _ in range(-rebuilder.step_count % self._steps_per_tick):
            self._step()
            rebuilder.step_count += 1
        self.clock.tick_count = rebuilder.step_count // self._steps_per_tick
        return self.clock.tick_count

    def cast_ray(self, origin: Array, direction: Array) -> Array | None:
        return self.world.cast_ray(origin, direction)

    def visuals(self) -> SimVisuals:
        return SimVisuals(self.world)

    def list_objects(self) -> Sequence[TrueObject]:
        return [self.world.describe_object(body) for body in self.world.labels]

    def list_final_objects(self) -> Iterator[TrueObject]:
        for body, positions in self.world.rest_positions.items():
            final_object = self.world.removed_objects.get(body) or self.world.describe_object(body)
            # The centre of an object that leans on a bin wall may be above the wall.
            position = final_object.position
            names = (name for name, bin in self._bins.items() if bin.contains(position, BIN_THICKNESS))
            yield replace(
                final_object,
                bin=None if position[2] < MIN_CENTRE_HEIGHT else next(names, ""),
                rest_positions=positions,
                is_dropped=body in self.tool.dropped_bodies,
                is_held=body == self.tool.held_body,
            )

    def find_held_object(self) -> TrueObject | None:
        body = self.tool.held_body
        return None if body is None else self.world.describe_object(body)

    @property
    def forgotten_count(self) -> int:
        return self.world.forgotten_count

    def remove_object(self, true_object: TrueObject, *, is_counted: bool = True) -> None:
        self.world.remove_object(true_object.body, is_counted=is_counted)

    def move_object(self, true_object: TrueObject, displacement: tuple[float, float]) -> None:
        X_WO = self.world.get_object_pose(true_object.body)
        position = X_WO.position + np.array([*displacement, 0.0])
        self.world.place_object(true_object.body, Pose(X_WO.rotation, position))

    def drop_held_object(self) -> None:
        self.tool.lose_grip()

    def collide(self, message: str) -> None:
        self.arm.stop_after_collision(message)

    def close(self) -> None:
        self.world.close()


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
        elif kind in (world_log.REMOVE, world_log.FORGET):
            world.remove_object(int(numbers[0]), is_counted=kind == world_log.REMOVE)
        else:
            actions: dict[str, Callable[[], object]] = {
                world_log.CLOSE: tool.close,
                world_log.OPEN: partial(tool.open, *numbers.tolist()),
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
