"""Work cell without physics: a fake arm, tool, camera and detectors, with the real ledger and localizer."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from executive.cell.config import CellConfig
from executive.cell.protocols import Routes
from executive.cell.workcell import CellOptions, KeyPath
from executive.cells.fake.arm import FakeArm, FakeTool, find_places_out_of_reach
from executive.cells.fake.camera import FakeCamera, FakeDetector
from executive.cells.fake.state_log import FakeStateLog, restore_world
from executive.cells.fake.visuals import FakeVisuals
from executive.cells.fake.world import FakeWorld, describe_lack_of_room, put_random_objects
from executive.cells.ground_truth import FinalObject, count_outcomes
from executive.cells.table_views import find_view_errors
from executive.cells.without_hardware import CellWithoutHardware
from executive.errors import InputError
from executive.events import Emit, discard_event
from executive.geometry import Pose
from executive.mission.parse.cell_file import load_cell
from executive.mission.text.file_search import get_shipped_folder
from executive.motion.arms import find_arm_errors
from executive.perception.detectors.screening import screen_detectors
from executive.perception.localization import CellLocalizer

SHIPPED_ROUTES = {"cube": ("red_bin",), "sphere": ("blue_bin",), "duck": ("yellow_bin",)}
"""Permitted bins of each class of the shipped cells."""


class SilentOperator:
    """Operator without a terminal, who requests the classes of a list in order."""

    def __init__(self, requests: Sequence[str] = ()) -> None:
        self._requests = list(requests)

    def ask(self, choices: Sequence[str]) -> str | None:
        """Return the next class of the list, or None at the end of the list."""
        del choices
        return self._requests.pop(0) if self._requests else None


class FakeCell(CellWithoutHardware):
    """The cell of a cell file without physics; implements `executive.cell.workcell.Workcell`.

    Bins, classes, table, poses, camera, detectors and ledger follow the cell file. The arm moves along
    straight lines, table and bins are obstacles, the tool always seals, and every detector finds all objects.

    Args:
        config: The cell file; by default the result of `load_empty_cell`.
        seed: Random seed for the classes and positions of the objects.
        routes: Names of the permitted bins of each class.
        emit: Receives the events of the cell.
        options: Options of the run; by default, the operator requests nothing.

    Attributes:
        world: Objects and bins.
        arm: The fake arm.
        tool: The fake tool.
        camera: The fake camera.
        detectors: The fake detectors by name.
        detector: The first detector.
        ledger: The ledger of the run, the same object as `accounts`.

    Raises:
        InputError: The workspace has no room for the objects, or `options` request a window.
    """

    def __init__(
        self,
        config: CellConfig | None = None,
        *,
        seed: int = 0,
        routes: Routes = SHIPPED_ROUTES,
        emit: Emit = discard_event,
        options: CellOptions | None = None,
    ) -> None:
        config = config or load_empty_cell()
        options = options or CellOptions(SilentOperator(), cell_folder=Path())
        if options.gui:
            raise InputError(f'cell {config.cell} is of kind "fake" and has no window; run it without --gui')
        super().__init__(config, seed=seed, routes=routes, emit=emit, options=options)
        classes, clock, bins = self.cell.classes, self.cell.clock, tuple(self.cell.bins.values())
        self.ledger = self.accounts
        self.world = FakeWorld(classes, bins=bins)
        put_random_objects(self.world, config, seed)
        self.arm = FakeArm(self.world, config, clock, emit)
        self.tool = FakeTool(self.world, lambda: self.arm.tool_pose.position, config.tool.load_std)
        name, camera = next(iter(config.cameras.items()))
        X_TF = Pose.of((0.0, 0.0, -config.tool.length))  # pose of the flange F in the frame T of the tool
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
        self._log: FakeStateLog | None = None
        if options.resume is not None:
            self.steps, self.last_command_step = restore_world(options.resume.log_path, self.world, self.arm)
            self.camera.set_counts(options.resume.frame_count, options.resume.pose_count)
            self.log_to(options.resume.log_path)
        self.cell = replace(
            self.cell,
            arm=self.arm,
            tool=self.tool,
            camera=self.camera,
            detectors=screen_detectors(self.detectors, classes),
            localizer=CellLocalizer("plane", classes, bins),
        )

    @staticmethod
    def check(config: CellConfig, cell_folder: Path) -> Iterable[tuple[KeyPath, str]]:
        """Return key and message for an unsupported arm, places out of reach, lack of room, and bad views."""
        del cell_folder
        if arm_errors := tuple(find_arm_errors(config)):
            return arm_errors
        room_error = describe_lack_of_room(config, config.table.objects[1])
        room_errors = [(("table", "objects"), room_error)] if room_error else []
        return (*find_places_out_of_reach(config), *room_errors, *find_view_errors(config))

    @staticmethod
    def labels(config: CellConfig, cell_folder: Path) -> Mapping[str, tuple[str, ...] | None]:
        """Return None for every detector: a fake detector knows all classes."""
        del cell_folder
        return dict.fromkeys(config.detectors)

    def log_to(self, path: Path) -> None:
        """Write the state of the world to a log file, now and after every control step."""
        self._log = FakeStateLog(path)
        self.log_state()

    def log_state(self) -> None:
        """Write the current state of the world to the log."""
        if self._log is not None:
            self._log.write_state(self.steps, self.last_command_step, self.world, self.arm)

    def advance(self) -> None:
        """Advance arm and ledger by one control step, and log the state."""
        if self.world.is_commanded:
            self.last_command_step, self.world.is_commanded = self.steps, False
        self.arm.advance()
        super().advance()
        self.log_state()

    def visuals(self) -> FakeVisuals:
        """Return the shapes in the cell for display."""
        return FakeVisuals(self.config, self.world, lambda: self.arm.tool_pose)

    def audit(self) -> dict[str, int]:
        """Return the number of objects by outcome, such as `right`, `wrong_bin`, `left` and `elsewhere`."""
        held, removed = self.world.held_object, self.world.removed_objects
        objects = []
        for each in (*self.world.objects, *removed):
            bin, positions, is_removed = self.world.find_bin(each), each.rest_positions, each in removed
            name = bin.name if bin else ""
            entry = FinalObject(each.label, name, positions, each.is_dropped, each is held, is_removed)
            objects.append(entry)
        gate = self.config.ledger.gate
        ignored = self.ledger.ignored_positions
        return count_outcomes(objects, self.ledger.records, self.cell.bins, self.routes, gate, ignored)

    def close(self) -> None:
        """Close the log."""
        if self._log is not None:
            self._log.close()


@functools.cache
def load_empty_cell() -> CellConfig:
    """Return the shipped cell `overhead` as a fake cell without objects, for tests of single skills."""
    path = get_shipped_folder() / "cells" / "overhead.yaml"
    return load_cell(path, {"cell.kind": "fake", "cell.table.objects": "[0, 0]"})
