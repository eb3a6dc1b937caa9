"""Simulated work cell: arm, tool, camera and detectors in a PyBullet world."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from executive.cell.config import CellConfig
from executive.cell.objects import BIN_THICKNESS, Bin
from executive.cell.protocols import Routes
from executive.cell.workcell import CellOptions, TrueObject
from executive.drivers.sim.arm import SimArm
from executive.drivers.sim.camera import SimCamera, find_missing_depth_sensors
from executive.drivers.sim.collision import ClearanceChecker
from executive.drivers.sim.models import build_simulated_class
from executive.drivers.sim.rebuild import WorldRebuilder
from executive.drivers.sim.scene import build_initial_world, derive_seeds, load_scene
from executive.drivers.sim.tool import SimTool
from executive.drivers.sim.world import SimVisuals, World
from executive.drivers.world_log import CommandLog, read_commands
from executive.errors import InputError
from executive.events import Emit
from executive.motion.planner import Planner
from executive.perception.detectors.envelope import build_rated_detectors
from executive.perception.detectors.requests import ClosableDetector
from executive.perception.localization import CellLocalizer
from executive.station.without_hardware import CellWithoutHardware
from executive.text.yaml_files import get_shipped_folder

MIN_CENTRE_HEIGHT = -0.05
"""Minimum height of the centre of an object that is still on the table [m]."""


class SimCell(CellWithoutHardware):
    """The simulated cell of a cell file; implements `executive.cell.workcell.Workcell`.

    Args:
        config: The cell file.
        seed: Random seed of the objects, their poses and the noise of camera, detectors and load cell.
        routes: Names of the permitted bins of each class.
        emit: Receives the events of the cell.
        options: Options of the run.
        build_camera: Builds the camera from the arguments of `SimCamera`.
        build_detectors: Builds the detectors from the arguments of `build_rated_detectors`.

    Raises:
        InputError: The simulated cell does not support the cell file, or the scene file is invalid.
    """

    def __init__(
        self,
        config: CellConfig,
        *,
        seed: int,
        routes: Routes,
        emit: Emit,
        options: CellOptions,
        build_camera: Callable[..., SimCamera] = SimCamera,
        build_detectors: Callable[..., Mapping[str, ClosableDetector]] = build_rated_detectors,
    ) -> None:
        for _, message in find_missing_depth_sensors(config):
            raise InputError(f"cell {config.cell}: {message}")
        super().__init__(config, seed=seed, routes=routes, emit=emit, options=options)
        clock = self.cell.clock
        bins = tuple(self.cell.bins.values())
        _, camera_seed, detector_seed, load_seed = derive_seeds(seed)
        scene = load_scene(options.scene, config)
        world = self._world = build_initial_world(config, seed, gui=options.gui, scene=scene)
        self._clearance_checker = ClearanceChecker(config)
        planner = Planner(config, self._clearance_checker.check)
        self._tool: SimTool = config.tool.build_sim(world, load_seed)
        rebuilder = None if options.resume is None else self._rebuild_world(options.resume.log_path)
        self._arm = SimArm(world, planner, config, clock, lambda: self._tool.held_body, emit, rebuilder)
        self._camera = build_camera(
            world,
            config,
            clock,
            camera_seed,
            is_loaded=lambda: self._tool.holding,
            get_change_count=lambda: self.accounts.change_count,
            light=scene.light,
            bins=bins,
        )
        classes = {label: build_simulated_class(label, section) for label, section in config.objects.items()}
        localizer = CellLocalizer(config.localization, classes, bins, self._world.cast_ray)
        # Detectors are built last, because their processes would outlive an exception in a later statement.
        folders = (options.cell_folder, get_shipped_folder() / "cells")
        self._detectors = build_detectors(
            config, clock=clock, base=options.cell_folder, seed=detector_seed, folders=folders
        )
        self.cell = replace(self.cell, classes=classes)
        self._connect(options, self._arm, self._tool, self._camera, self._detectors, localizer)

    def log_to(self, path: Path) -> None:
        self._world.log = CommandLog(path)
        self._arm.send_command()

    def advance(self) -> None:
        self._arm.advance()
        self._world.step()
        super().advance()
        self._tool.advance()

    def visuals(self) -> SimVisuals:
        return SimVisuals(self._world)

    def _list_final_objects(self) -> Iterator[TrueObject]:
        return list_final_objects(self._world, self._tool, self.cell.bins)

    def close(self) -> None:
        for detector in self._detectors.values():
            detector.close()
        self._arm.close()
        self._clearance_checker.close()
        self._world.close()

    def _rebuild_world(self, log: Path) -> WorldRebuilder:
        """Execute the commands of a log, continue the log, and return the rebuilder."""
        rebuilder = WorldRebuilder(self._world, self._tool)
        for command in read_commands(log):
            rebuilder.execute(command)
        self.steps = rebuilder.step_count
        self.last_command_step = rebuilder.last_command_step
        self._world.log = CommandLog(log, resume=True)
        return rebuilder


def list_final_objects(world: World, tool: SimTool, bins: Mapping[str, Bin]) -> Iterator[TrueObject]:
    """Yield the objects of a simulated world, including removed objects, at the end of a run."""
    for body, positions in world.rest_positions.items():
        final_object = world.removed_objects.get(body) or world.describe_object(body)
        # The centre of an object that leans on a bin wall may be above the wall.
        position = final_object.position
        names = (name for name, bin in bins.items() if bin.contains(position, BIN_THICKNESS))
        final_object.bin = None if position[2] < MIN_CENTRE_HEIGHT else next(names, "")
        final_object.rest_positions = positions
        final_object.is_dropped = body in tool.dropped_bodies
        final_object.is_held = body == tool.held_body
        yield final_object
