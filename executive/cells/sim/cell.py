"""The simulated work cell: arm, tool, camera and detectors around one PyBullet world."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from executive.cell.clock import STEP
from executive.cell.config import CellConfig
from executive.cell.layout import bins_of, cell_without_hardware
from executive.cell.protocols import Cell, Routes
from executive.cell.workcell import Accounts, CellOptions, KeyPath
from executive.cells.sim.arm import SimArm
from executive.cells.sim.audit import audit
from executive.cells.sim.camera import SimCamera
from executive.cells.sim.clock import SimClock
from executive.cells.sim.collision import PathClearance
from executive.cells.sim.command_log import CommandLog, read_commands
from executive.cells.sim.least_times import SimLeastTimes
from executive.cells.sim.models import missing_models, weighed
from executive.cells.sim.poses import out_of_reach, unfit_poses
from executive.cells.sim.rebuild import UnderWay, rebuild
from executive.cells.sim.scene_file import load_scene
from executive.cells.sim.scene_world import build_light
from executive.cells.sim.spawn import PartSeeds, find_lack_of_room, first_world
from executive.cells.sim.tool import SuctionTool
from executive.cells.sim.view import ArmShadow
from executive.cells.sim.visuals import SimScenery
from executive.errors import InputError
from executive.events import Emit
from executive.ledger.tracker import ItemLedger
from executive.mission.text.files import shipped_folder
from executive.motion.arms import build_planner, find_unsupported_arm
from executive.perception.detectors.registry import find_problems, known_labels
from executive.perception.detectors.screening import screen_detectors
from executive.perception.detectors.setting import ClosableDetector
from executive.perception.envelope.rated_detectors import build_rated_detectors
from executive.perception.evidence import classes_distinct_by_touch
from executive.perception.localization.localizer import build_localizer


class SimCell:
    """A cell file brought to life; implements `executive.cell.workcell.Workcell`.

    Args:
        config: The cell file.
        seed: Decides which objects lie where, and the camera's noise.
        routes: Class label to the bins that are right for it.
        emit: Tells the run what happens.
        options: How the run wants its cell.
        camera: Makes the camera.
        detectors: Makes the detectors; by default the installed kinds that the cell file names.

    Raises:
        InputError: The cell asks for something the simulated cell cannot do yet, or the scene file is wrong.
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
        for _, sentence in _lacking_depth(config):
            raise InputError(f"cell {config.cell}: {sentence}")
        seeds = PartSeeds.of(seed)
        self._config = config
        self._routes = dict(routes)
        scene = load_scene(options.scene, config)
        self._world = first_world(config, seed, gui=options.gui, scene=scene)
        self._initial = {body: self._world.object_pose(body).position for body in self._world.bodies}
        self._bins = bins_of(config)
        self._clock = clock = SimClock(self._world, STEP)
        self._clearance = PathClearance(config)
        planner = build_planner(config, self._clearance.check)
        self._tool = SuctionTool(self._world, config.tool)
        under_way = None if options.resume is None else self._rebuilt(options.resume.log)
        self._arm = SimArm(self._world, planner, config, clock, lambda: self._tool.held_body, emit, under_way)
        self._ledger = ItemLedger(
            config.ledger, config.table, self._bins, routes, emit, classes_distinct_by_touch(config)
        )
        name, camera_config = next(iter(config.cameras.items()))
        self._camera = camera(
            self._world,
            name,
            camera_config,
            clock,
            seeds.camera,
            shadow=ArmShadow(self._arm, planner.kinematics, config, lambda: self._tool.holding),
            epoch=lambda: self._ledger.epoch,
            light=build_light(scene.light),
            true=self._world.config.cameras[name],
            bins=tuple(self._bins.values()),
        )
        if options.resume is not None:
            self._camera.skip(options.resume.frames, options.resume.turns)
        classes = {label: weighed(label, kind) for label, kind in config.objects.items()}

        localizer = build_localizer(config.localization, classes, self._bins.values(), self._world.cast_ray)
        # Last of all: some of them start processes, which nobody would end if something after them failed.
        folders = (options.base, shipped_folder() / "cells")
        self._detectors = detectors(
            config, clock=clock, base=options.base, seed=seeds.detectors, folders=folders
        )
        self._cell = replace(
            cell_without_hardware(config, self._routes, self._ledger, emit),
            clock=clock,
            arm=self._arm,
            tool=self._tool,
            camera=self._camera,
            detectors=screen_detectors(self._detectors, classes),
            operator=options.operator,
            classes=classes,
            localizer=localizer,
        )

    @staticmethod
    def check(config: CellConfig, base: Path) -> Iterable[tuple[KeyPath, str]]:
        """Return what this kind of cell cannot do of a cell file, with the key it is about.

        An unsupported arm, missing models and detectors, places out of reach, more objects than fit, poses in
        collision, and cameras that do not see the whole workspace.
        """
        if unsupported := tuple(find_unsupported_arm(config)):
            return unsupported
        missing = tuple(missing_models(config))
        return (
            *missing,
            *_lacking_depth(config),
            *find_problems(config.detectors, base),
            *out_of_reach(config),
            *find_lack_of_room(config),
            # A world cannot be made without its models.
            *(() if missing else unfit_poses(config)),
        )

    @staticmethod
    def labels(config: CellConfig, base: Path) -> Mapping[str, tuple[str, ...] | None]:
        """Return the classes that each detector knows, None where it does not say; loads no model."""
        return known_labels(config.detectors, base)

    @staticmethod
    def least_times(config: CellConfig) -> SimLeastTimes:
        """Return what things take at the very least."""
        return SimLeastTimes(config)

    @property
    def cell(self) -> Cell:
        """What skills see."""
        return self._cell

    @property
    def accounts(self) -> Accounts:
        """The books of the cell's ledger."""
        return self._ledger

    @property
    def steps(self) -> int:
        """Control steps that its world has made since the run began."""
        return self._clock.steps

    def log_to(self, path: Path) -> None:
        """Keep in a file, from now on, what is done to the world."""
        self._world.log = CommandLog(path, self._world.robot.joint_count)
        self._arm.hold()

    def advance(self) -> None:
        """Let one physics step pass."""
        self._arm.advance()
        self._world.step()
        self._tool.advance()

    def scenery(self) -> SimScenery:
        """Return what there is to be seen, for people only."""
        return SimScenery(self._world)

    def audit(self) -> dict[str, int]:
        """Return what really became of the objects; for after the run only."""
        return audit(
            self._world,
            {body: [place, *self._world.stood.get(body, ())] for body, place in self._initial.items()},
            self._ledger.records,
            self._bins,
            self._routes,
            self._config.ledger.gate,
            held=self._tool.held_body,
            fallen=self._tool.fallen,
        )

    def close(self) -> None:
        """End the detectors and the physics."""
        for detector in self._detectors.values():
            detector.close()
        self._clearance.close()
        self._world.close()

    def _rebuilt(self, log: Path) -> UnderWay:
        """Rebuild the world as its log says, and go on with the log."""
        under_way = rebuild(self._world, self._tool, read_commands(log))
        self._clock.skip(under_way.idle)
        self._world.log = CommandLog(log, self._world.robot.joint_count, again=True)
        return under_way


def _lacking_depth(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield the key and a sentence for every camera without the depth that the cell file localizes by."""
    if config.localization != "depth":
        return
    for name, camera in config.cameras.items():
        if camera.depth is None:
            yield (
                ("localization",),
                f'localization "depth" needs a camera with depth, and {name} has none; give it a section '
                '"depth: {}", or use "plane"',
            )
