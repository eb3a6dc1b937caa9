"""The simulated work cell: arm, tool, camera and detectors around one PyBullet world."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from executive.cell.config import CellConfig
from executive.cell.protocols import Routes
from executive.cell.workcell import CellOptions, KeyPath
from executive.cells.sim.arm import SimArm
from executive.cells.sim.audit import audit
from executive.cells.sim.camera import SimCamera
from executive.cells.sim.collision import PathClearance
from executive.cells.sim.command_log import CommandLog, read_commands
from executive.cells.sim.min_times import SimMinTimes
from executive.cells.sim.models import find_missing_models, object_class_with_mass
from executive.cells.sim.poses import find_places_out_of_reach, find_unfit_poses
from executive.cells.sim.rebuild import InterruptedArm, rebuild
from executive.cells.sim.scene_file import load_scene
from executive.cells.sim.scene_world import build_light
from executive.cells.sim.spawn import PartSeeds, find_lack_of_room, first_world
from executive.cells.sim.tool import SuctionTool
from executive.cells.sim.view import ArmShadow
from executive.cells.sim.visuals import SimVisuals
from executive.cells.without_hardware import CellWithoutHardware
from executive.errors import InputError
from executive.events import Emit
from executive.mission.text.files import shipped_folder
from executive.motion.arms import build_planner, find_unsupported_arm
from executive.perception.detectors.registry import find_known_labels, find_problems
from executive.perception.detectors.screening import screen_detectors
from executive.perception.detectors.setting import ClosableDetector
from executive.perception.envelope.rated_detectors import build_rated_detectors
from executive.perception.localization import build_localizer


class SimCell(CellWithoutHardware):
    """The simulated cell of a cell file; implements `executive.cell.workcell.Workcell`.

    Args:
        config: The cell file.
        seed: Random seed of the objects, their poses and the noise of the camera.
        routes: Class label to the correct bins of the class.
        emit: Receives the events of the cell.
        options: Options of the run.
        camera: Builds the camera.
        detectors: Builds the detectors; by default the installed kinds that the cell file names.

    Raises:
        InputError: The cell needs something that the simulated cell lacks, or the scene file is wrong.
    """

    def __init__(
        self,
        config: CellConfig,
        *,
        seed: int,
        routes: Routes,
        emit: Emit,
        options: CellOptions,
        camera: Callable[..., SimCamera] = SimCamera,
        detectors: Callable[..., Mapping[str, ClosableDetector]] = build_rated_detectors,
    ) -> None:
        for _, sentence in _find_lack_of_depth(config):
            raise InputError(f"cell {config.cell}: {sentence}")
        super().__init__(config, seed=seed, routes=routes, emit=emit, options=options)
        clock, bins = self.cell.clock, self.cell.bins.values()
        seeds = PartSeeds.of(seed)
        scene = load_scene(options.scene, config)
        self._world = first_world(config, seed, gui=options.gui, scene=scene)
        self._initial = {body: self._world.object_pose(body).position for body in self._world.bodies}
        self._clearance = PathClearance(config)
        planner = build_planner(config, self._clearance.check)
        self._tool = SuctionTool(self._world, config.tool)
        resumed = None if options.resume is None else self._rebuild(options.resume.log)
        self._arm = SimArm(self._world, planner, config, clock, lambda: self._tool.held_body, emit, resumed)
        name, camera_config = next(iter(config.cameras.items()))
        self._camera = camera(
            self._world,
            name,
            camera_config,
            clock,
            seeds.camera,
            shadow=ArmShadow(self._arm, planner.kinematics, config, lambda: self._tool.holding),
            epoch=lambda: self.accounts.epoch,
            light=build_light(scene.light),
            true=self._world.config.cameras[name],
            bins=tuple(bins),
        )
        if options.resume is not None:
            self._camera.skip(options.resume.frames, options.resume.turns)
        classes = {label: object_class_with_mass(label, kind) for label, kind in config.objects.items()}
        localizer = build_localizer(config.localization, classes, bins, self._world.cast_ray)
        # Detectors are built last: some start processes, which would go on if a later statement failed.
        folders = (options.base, shipped_folder() / "cells")
        self._detectors = detectors(
            config, clock=clock, base=options.base, seed=seeds.detectors, folders=folders
        )
        self.cell = replace(
            self.cell,
            arm=self._arm,
            tool=self._tool,
            camera=self._camera,
            detectors=screen_detectors(self._detectors, classes),
            classes=classes,
            localizer=localizer,
        )

    @staticmethod
    def check(config: CellConfig, base: Path) -> Iterable[tuple[KeyPath, str]]:
        """Return the demands of a cell file that the simulated cell cannot meet: key and sentence of each.

        An unsupported arm, missing models and detectors, places out of reach, more objects than fit, poses in
        collision, and cameras that do not see the whole workspace.
        """
        if unsupported := tuple(find_unsupported_arm(config)):
            return unsupported
        missing = tuple(find_missing_models(config))
        return (
            *missing,
            *_find_lack_of_depth(config),
            *find_problems(config.detectors, base),
            *find_places_out_of_reach(config),
            *find_lack_of_room(config),
            # Without its models a world cannot be built.
            *(() if missing else find_unfit_poses(config)),
        )

    @staticmethod
    def labels(config: CellConfig, base: Path) -> Mapping[str, tuple[str, ...] | None]:
        """Return the classes of each detector, None if they are unknown; loads no model."""
        return find_known_labels(config.detectors, base)

    @staticmethod
    def min_times(config: CellConfig) -> SimMinTimes:
        """Return the lower bounds of the times of motions and skills."""
        return SimMinTimes(config)

    def log_to(self, path: Path) -> None:
        """Record all commands to the world in a file from now on."""
        self._world.log = CommandLog(path, self._world.robot.joint_count)
        self._arm.hold()

    def advance(self) -> None:
        """Advance the cell by one physics step."""
        self._arm.advance()
        self._world.step()
        super().advance()
        self._tool.advance()

    def visuals(self) -> SimVisuals:
        """Return the shapes of the world for display."""
        return SimVisuals(self._world)

    def audit(self) -> dict[str, int]:
        """Return counts of the true outcomes of the objects, to be used only after the run."""
        return audit(
            self._world,
            {body: [place, *self._world.stood.get(body, ())] for body, place in self._initial.items()},
            self.accounts.records,
            self.cell.bins,
            self.routes,
            self.config.ledger.gate,
            held=self._tool.held_body,
            fallen=self._tool.fallen,
        )

    def close(self) -> None:
        """Close the detectors and the physics servers."""
        for detector in self._detectors.values():
            detector.close()
        self._clearance.close()
        self._world.close()

    def _rebuild(self, log: Path) -> InterruptedArm:
        """Rebuild the world from its log, and continue the log."""
        resumed = rebuild(self._world, self._tool, read_commands(log))
        self.steps, self.last_command = resumed.steps, resumed.last_command
        self._world.log = CommandLog(log, self._world.robot.joint_count, again=True)
        return resumed


def _find_lack_of_depth(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and sentence for each camera without a depth sensor if the cell localizes by depth."""
    if config.localization != "depth":
        return
    for name, camera in config.cameras.items():
        if camera.depth is None:
            yield (
                ("localization",),
                f'localization "depth" needs a camera with depth, and {name} has none; give it a section '
                '"depth: {}", or use "plane"',
            )
