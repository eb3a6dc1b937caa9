"""Driver of the simulated cell: arm, tool and camera in a PyBullet world."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.device_config import STEP
from executive.cell.devices import DEFAULT_ROLE, DriverOptions, StepClock, TrueObject, derive_seeds
from executive.cell.objects import BIN_THICKNESS
from executive.drivers.sim.arm import SimArm
from executive.drivers.sim.camera import SimCamera, find_missing_depth_sensors
from executive.drivers.sim.models import compute_mass, find_model_errors
from executive.drivers.sim.rebuild import WorldRebuilder
from executive.drivers.sim.scene import build_world_of_run, find_object_count_errors
from executive.drivers.sim.tool import SimTool
from executive.drivers.sim.world import SimVisuals
from executive.drivers.world_log import CommandLog, read_commands
from executive.errors import InputError
from executive.geometry import Array, Pose
from executive.motion.joints import JointLimits
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
        self._bins = config.build_bins()

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

    def remove_object(self, true_object: TrueObject) -> None:
        self.world.remove_object(true_object.body)

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
