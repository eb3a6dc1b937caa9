"""Work cell without physics: fake arm, tool, camera and detectors, with the real ledger and localizer."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from executive.cell.bins import BIN_THICKNESS
from executive.cell.config import CellConfig
from executive.cell.protocols import MinTimes, Routes
from executive.cell.workcell import CellOptions, KeyPath
from executive.cells.audit import FinalObject, audit_objects
from executive.cells.fake.arm import FakeArm, FakeTool, find_places_out_of_reach
from executive.cells.fake.camera import FakeCamera, FakeDetector
from executive.cells.fake.command_log import FakeLog, restore_world
from executive.cells.fake.min_times import FakeMinTimes
from executive.cells.fake.visuals import FakeVisuals
from executive.cells.fake.world import FakeObject, FakeWorld
from executive.cells.without_hardware import CellWithoutHardware
from executive.errors import Fault, InputError
from executive.events import Emit, discard_event
from executive.geometry import Pose
from executive.mission.parse.cell_file import load_cell
from executive.mission.text.file_search import get_shipped_folder
from executive.motion.arms import find_arm_errors
from executive.perception.detectors.screening import screen_detectors
from executive.perception.localization import build_localizer

ROUTES = {"cube": ("red_bin",), "sphere": ("blue_bin",), "duck": ("yellow_bin",)}
"""Permitted bins of each class of the shipped cells."""


class SilentOperator:
    """Operator without a terminal, who requests the classes of a list in order, and then quits."""

    def __init__(self, requests: Sequence[str] = ()) -> None:
        self._requests = list(requests)

    def ask(self, choices: Sequence[str]) -> str | None:
        """Return the next request of the list, or None at its end."""
        del choices
        return self._requests.pop(0) if self._requests else None


class FakeCell(CellWithoutHardware):
    """The cell of a cell file without physics; implements `executive.cell.workcell.Workcell`.

    Bins, classes, table, poses, camera, detectors and ledger follow the cell file. The arm moves along
    straight lines, table and bins are obstacles, the tool always seals, and every detector finds all objects.

    Args:
        config: The cell file; by default `load_empty_cell`.
        seed: Random seed of the classes and positions of the objects.
        routes: Names of the permitted bins of each class.
        emit: Receives the events of the cell.
        options: Options of the run; by default with an operator who requests nothing.

    Attributes:
        world: Objects and bins.
        arm: The fake arm.
        tool: The fake tool.
        camera: The fake camera.
        detectors: The fake detectors by name.
        detector: The first detector.
        ledger: The ledger, as in every cell.

    Raises:
        InputError: The workspace has no room for the objects, or `options` request a window.
    """

    def __init__(
        self,
        config: CellConfig | None = None,
        *,
        seed: int = 0,
        routes: Routes = ROUTES,
        emit: Emit = discard_event,
        options: CellOptions | None = None,
    ) -> None:
        config = config or load_empty_cell()
        options = options or CellOptions(SilentOperator(), base=Path())
        if options.gui:
            raise InputError(f'cell {config.cell} is of kind "fake" and has no window; run it without --gui')
        super().__init__(config, seed=seed, routes=routes, emit=emit, options=options)
        classes, clock, bins = self.cell.classes, self.cell.clock, tuple(self.cell.bins.values())
        self.ledger = self.accounts
        self.world = FakeWorld(classes, bins=bins)
        put_random_objects(self.world, config, seed)
        self.arm = FakeArm(self.world, config, clock, emit)
        self.tool = FakeTool(self.world, lambda: self.arm.tool_pose.position)
        name, camera = next(iter(config.cameras.items()))
        X_TF = Pose.of((0.0, 0.0, -config.tool.length))
        self.camera = FakeCamera(
            name,
            camera,
            config.table,
            get_flange_pose=lambda: self.arm.tool_pose @ X_TF,
            clock=clock,
            get_change_count=lambda: self.ledger.change_count,
        )
        self.detectors = {
            name: FakeDetector(name, detector, self.world, clock, self.camera.get_view_box)
            for name, detector in config.detectors.items()
        }
        self.detector = next(iter(self.detectors.values()))
        self._log: FakeLog | None = None
        if options.resume is not None:
            self.steps, self.last_command = restore_world(options.resume.log_path, self.world, self.arm)
            self.camera.set_counts(options.resume.frame_count, options.resume.pose_count)
            self.log_to(options.resume.log_path)
        self.cell = replace(
            self.cell,
            arm=self.arm,
            tool=self.tool,
            camera=self.camera,
            detectors=screen_detectors(self.detectors, classes),
            localizer=build_localizer("plane", classes, bins),
        )

    @staticmethod
    def check(config: CellConfig, base: Path) -> Iterable[tuple[KeyPath, str]]:
        """Return a finding for an unsupported arm, each place out of reach, and more objects than fit."""
        del base
        if unsupported := tuple(find_arm_errors(config)):
            return unsupported
        problem = _describe_lack_of_room(config, config.table.objects[1])
        return (*find_places_out_of_reach(config), *([(("table", "objects"), problem)] if problem else []))

    @staticmethod
    def labels(config: CellConfig, base: Path) -> Mapping[str, tuple[str, ...] | None]:
        """Return None for every detector: a fake detector knows all classes."""
        del base
        return dict.fromkeys(config.detectors)

    @staticmethod
    def min_times(config: CellConfig) -> MinTimes:
        """Return the minimum times of the stages of a task in a cell of this configuration."""
        return FakeMinTimes(config)

    def log_to(self, path: Path) -> None:
        """Write the state of the world to a log file, now and after every control step."""
        self._log = FakeLog(path)
        try:
            self.log_state()
        except Fault as fault:
            raise InputError(str(fault)) from fault

    def log_state(self) -> None:
        """Write the current state of the world to the log."""
        if self._log is not None:
            self._log.write_state(self.steps, self.last_command, self.world, self.arm)

    def advance(self) -> None:
        """Advance arm and log by one control step."""
        if self.world.is_commanded:
            self.last_command, self.world.is_commanded = self.steps, False
        self.arm.advance()
        super().advance()
        self.log_state()

    def visuals(self) -> FakeVisuals:
        """Return the shapes in the cell for display."""
        return FakeVisuals(self.config, self.world, lambda: self.arm.tool_pose)

    def audit(self) -> dict[str, int]:
        """Return the counts of `executive.cells.audit.audit_objects` for the objects of the cell."""
        world = self.world
        objects = []
        for is_removed, group in ((False, world.objects), (True, world.removed_objects)):
            for obj in group:
                bin = self._find_bin(obj)
                # If a resumed run first detects an item in a bin, its first position is the bin's centre.
                centres = [self.cell.bins[bin].position] if bin else []
                positions, is_held = [*obj.rest_positions, *centres], obj is world.held
                objects.append(FinalObject(obj.label, bin, positions, obj.is_dropped, is_held, is_removed))
        return audit_objects(objects, self.ledger.records, self.routes, self.config.ledger.gate)

    def _find_bin(self, fake_object: FakeObject) -> str:
        """Return the name of the bin in which an object lies, or ""."""
        # An object on the wall of a bin counts as being in the bin, unless it is inside another bin.
        wall = BIN_THICKNESS + self.cell.classes[fake_object.label].radius / 2
        for margin in (0.0, wall):
            for name, bin in self.cell.bins.items():
                if bin.contains(fake_object.position, margin):
                    return name
        return ""

    def close(self) -> None:
        """Close the log."""
        if self._log is not None:
            self._log.close()
            self._log = None


@functools.cache
def load_empty_cell() -> CellConfig:
    """Return the shipped cell `overhead` as a fake cell without objects, for tests of single skills."""
    path = get_shipped_folder() / "cells" / "overhead.yaml"
    return load_cell(path, {"cell.kind": "fake", "cell.table.objects": "[0, 0]"})


def put_random_objects(world: FakeWorld, config: CellConfig, seed: int) -> None:
    """Put objects of random classes on random points of a grid; their number is in the cell file's range.

    Raises:
        InputError: The workspace has no room for this number of objects.
    """
    random = np.random.default_rng(seed)
    count = int(random.integers(*config.table.objects, endpoint=True))
    if problem := _describe_lack_of_room(config, count):
        raise InputError(problem)
    points, _ = _compute_grid_points(config)
    for index in random.permutation(len(points))[:count]:
        world.put(str(random.choice(list(config.objects))), *points[index])


def _compute_grid_points(config: CellConfig) -> tuple[list[tuple[float, float]], float]:
    """Return the grid points for objects on the table [m], and the distance between them [m]."""
    pitch = 2 * max(kind.radius for kind in config.objects.values()) + config.table.gap
    sides = config.table.x, config.table.y
    xs, ys = (np.linspace(low, high, 1 + int((high - low) / pitch)) for low, high in sides)
    return [(float(x), float(y)) for x in xs for y in ys], pitch


def _describe_lack_of_room(config: CellConfig, count: int) -> str:
    """Return a message if the workspace lacks room for `count` objects, else ""."""
    points, pitch = _compute_grid_points(config)
    message = (
        f"{count} objects find no room on the workspace of cell {config.cell}, which has {len(points)} "
        f"places {pitch:.3f} m apart; ask for fewer or widen table.x and table.y"
    )
    return message if count > len(points) else ""
