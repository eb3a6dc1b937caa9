"""Work cell without physics: a fake arm, tool, camera and detectors, with the real ledger and localizer."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import CellConfig, DetectorConfig
from executive.cell.detection import Detection
from executive.cell.frame import Box, Frame
from executive.cell.protocols import Clock, Routes
from executive.cell.workcell import CellOptions, KeyPath
from executive.cells.fake.arm import FakeArm
from executive.cells.fake.world import FakeObject, FakeTool, FakeWorld, list_grid_points, put_random_objects
from executive.cells.ground_truth import FinalObject, count_outcomes
from executive.cells.log_file import LogFile
from executive.cells.table_views import find_view_errors
from executive.cells.without_hardware import CellWithoutHardware
from executive.errors import InputError, Unavailable
from executive.events import Emit, discard_event
from executive.geometry import Pose
from executive.mission.parse.cell_file import load_cell
from executive.mission.text.file_search import get_shipped_folder
from executive.motion.arms import find_arm_errors, find_places_out_of_reach
from executive.perception.camera_model import MountedCamera, compute_hull_mask
from executive.perception.detectors.requests import PendingSearch
from executive.perception.detectors.screening import screen_detectors
from executive.perception.localization import CellLocalizer

SHIPPED_ROUTES = {"cube": ("red_bin",), "sphere": ("blue_bin",), "duck": ("yellow_bin",)}
"""Permitted bins of each class of the shipped cells."""
DEFAULT_CONFIDENCE = 0.9
"""Confidence of the detections of a fake detector, unless the threshold in the cell file is higher."""


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

    Bins, classes, table, poses, camera, detectors and ledger follow the cell file. The arm moves on straight
    joint paths, the tool always seals, and every detector finds all objects.

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
        InputError: `options` request a window, or the state of a resumed run cannot be read.
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
        self.world = FakeWorld(classes, bins)
        put_random_objects(self.world, config, seed)
        self.arm = FakeArm(self.world, config, clock, emit)
        self.tool = FakeTool(self.world, lambda: self.arm.tool_pose.position, config.tool.load_std)
        self.camera = FakeCamera(config, self.arm, clock, lambda: self.ledger.change_count)
        self.detectors = {
            name: FakeDetector(name, detector, self.world, clock, self.camera.get_view_box)
            for name, detector in config.detectors.items()
        }
        self.detector = next(iter(self.detectors.values()))
        self._log: LogFile | None = None
        self._log_length = 0
        if options.resume is not None:
            self._restore_state(options.resume.log_path)
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
        """Yield key and message for an unsupported arm, places out of reach, lack of room, and bad views."""
        del cell_folder
        if arm_errors := tuple(find_arm_errors(config)):
            yield from arm_errors
            return
        yield from find_places_out_of_reach(config)
        max_count, place_count = config.table.objects[1], len(list_grid_points(config))
        if max_count > place_count:
            message = f"{max_count} objects find no room on the workspace, which has {place_count} places; "
            yield ("table", "objects"), message + "ask for fewer or widen table.x and table.y"
        yield from find_view_errors(config)

    @staticmethod
    def labels(config: CellConfig, cell_folder: Path) -> Mapping[str, tuple[str, ...] | None]:
        """Return None for every detector: a fake detector knows all classes."""
        del cell_folder
        return dict.fromkeys(config.detectors)

    def log_to(self, path: Path) -> None:
        """Write the state of the world to a log file, now and after every control step."""
        self._log = LogFile(path, "the state of the world")
        self.log_state()

    def log_state(self) -> None:
        """Write the current state of the world to the log."""
        if self._log is None:
            return
        held = self.world.held_object
        index = None if held is None else self.world.objects.index(held)
        objects = [*map(vars, self.world.objects)], [*map(vars, self.world.removed_objects)]
        state = [self.steps, self.last_command_step, self.arm.q, index, *objects]
        text = json.dumps(state, default=np.ndarray.tolist).encode()
        # Blanks pad the text to the length of the longest state so far, to overwrite all old text.
        self._log_length = max(self._log_length, len(text))
        self._log.write(text.ljust(self._log_length), 0)

    def _restore_state(self, path: Path) -> None:
        try:
            steps, last_command_step, q, held, *objects = json.loads(path.read_bytes())
            self.steps = int(steps)
            self.last_command_step = int(last_command_step)
            self.arm.q = np.array(q, dtype=float).reshape(self.arm.q.shape)
            read_objects = [[_read_object(**fields) for fields in group] for group in objects]
            self.world.objects[:], self.world.removed_objects[:] = read_objects
            self.world.held_object = None if held is None else self.world.objects[held]
        except (OSError, ValueError, TypeError, LookupError, RecursionError) as error:
            problem = f'the world cannot be rebuilt from "{path}": {error}'
            raise InputError(f"{problem}; run the mission again from its start") from error

    def advance(self) -> None:
        """Advance arm and ledger by one control step, and log the state."""
        if self.world.is_commanded:
            self.last_command_step = self.steps
            self.world.is_commanded = False
        self.arm.advance()
        super().advance()
        self.log_state()

    def audit(self) -> dict[str, int]:
        """Return the number of objects by outcome, such as `right`, `wrong_bin`, `left` and `elsewhere`."""
        removed = self.world.removed_objects
        objects = []
        for each in (*self.world.objects, *removed):
            bin = self.world.find_bin(each)
            name = bin.name if bin else ""
            is_held = each is self.world.held_object
            final = FinalObject(
                each.label, name, each.rest_positions, each.is_dropped, is_held, each in removed
            )
            objects.append(final)
        gate, ignored = self.config.ledger.gate, self.ledger.ignored_positions
        return count_outcomes(objects, self.ledger.records, self.cell.bins, self.routes, gate, ignored)

    def close(self) -> None:
        """Close the arm and the log."""
        self.arm.close()
        if self._log is not None:
            self._log.close()


class FakeCamera(MountedCamera):
    """The camera of a cell file, with blank images.

    Attributes:
        is_table_visible: Function that returns True if the whole workspace is in the image, by default
            without regard to occlusion; set by tests.
        occluded_regions: Regions of the image that frames mark as occluded [pixel]; set by tests.
        displacement_message: Message about a displacement of the camera, "" for none; set by tests.
    """

    def __init__(
        self, config: CellConfig, arm: FakeArm, clock: Clock, get_change_count: Callable[[], int]
    ) -> None:
        name, camera = next(iter(config.cameras.items()))
        X_TF = Pose.of((0.0, 0.0, -config.tool.length))  # pose of the flange F in the frame T of the tool
        super().__init__(name, camera, lambda: arm.tool_pose @ X_TF, clock, get_change_count)
        self.is_table_visible: Callable[[], bool] = self._is_table_in_image
        self.occluded_regions: list[Box] = []
        self.displacement_message = ""
        self._corners = np.array([(x, y, 0.0) for x in config.table.x for y in config.table.y])

    def sees_table(self) -> bool:
        """Return the result of `is_table_visible`."""
        return self.is_table_visible()

    def describe_displacement(self, frame: Frame) -> str:
        """Return the value of `displacement_message`."""
        del frame
        return self.displacement_message

    def _capture_images(self) -> tuple[NDArray[np.uint8], None]:
        return np.zeros((self.config.height, self.config.width, 3), dtype=np.uint8), None

    def _compute_visibility_mask(self, X_WC: Pose) -> NDArray[np.bool_]:
        del X_WC
        mask = np.ones((self.config.height, self.config.width), dtype=bool)
        for left, top, right, bottom in self.occluded_regions:
            mask[int(top) : int(bottom), int(left) : int(right)] = False
        return mask

    def _is_table_in_image(self) -> bool:
        return compute_hull_mask(self._corners, self.matrix, self._compute_pose(), self._size) is not None


@dataclass(eq=False)
class FakeDetector:
    """A detector that finds every object in a view, unless a test replaces `make_answer`.

    Attributes:
        name: Name of the detector in the cell file.
        config: Section of the detector in the cell file.
        world: The world with the true objects.
        clock: Clock of the run.
        get_view_region: Returns the image region [pixel] of a view, which is `table` or `full`.
        make_answer: Returns the detections, or a message if the detector is unavailable. Its arguments are
            the number of the request (from 1) and the true detections.
        request_count: Number of requests so far.
    """

    name: str
    config: DetectorConfig
    world: FakeWorld
    clock: Clock
    get_view_region: Callable[[str], Box]
    make_answer: Callable[[int, Sequence[Detection]], Sequence[Detection] | str] = field(
        default=lambda _request_number, true_detections: true_detections
    )
    request_count: int = 0

    def request(self, frame: Frame, view: str) -> PendingSearch:
        """Return a request for the objects in a view of a frame, with the latency of the cell file."""
        self.request_count += 1
        left, top, right, bottom = self.get_view_region(view)
        true_detections = []
        for fake_object in self.world.objects:
            x, y, depth = frame.matrix @ frame.X_WC.inverse().apply(fake_object.position)
            column, row = x / depth, y / depth
            is_inside = depth > 0 and left <= column < right and top <= row < bottom
            if is_inside and fake_object is not self.world.held_object:
                half_side = frame.matrix[0, 0] / depth * self.world.classes[fake_object.label].radius
                box = (column - half_side, row - half_side, column + half_side, row + half_side)
                confidence = max(DEFAULT_CONFIDENCE, self.config.threshold)
                true_detections.append(Detection(fake_object.label, confidence, box))
        answer = self.make_answer(self.request_count, true_detections)
        future: Future[list[Detection]] = Future()
        if isinstance(answer, str):
            future.set_exception(Unavailable(answer))
        else:
            future.set_result(list(answer))
        due_time = self.clock.now + self.config.latency
        return PendingSearch(future, due_time, self.clock, self.name, self.config.error_rates)

    def close(self) -> None:
        """Do nothing: the detector holds no resources."""


def _read_object(
    label: str, position: object, rest_positions: Sequence[object], is_dropped: bool
) -> FakeObject:
    """Return an object from its attributes in the log."""
    current, *others = np.array([position, *rest_positions], dtype=float).reshape(-1, 3)
    return FakeObject(str(label), current, others, bool(is_dropped))


@functools.cache
def load_empty_cell() -> CellConfig:
    """Return the shipped cell `overhead` as a fake cell without objects, for tests of single skills."""
    path = get_shipped_folder() / "cells" / "overhead.yaml"
    return load_cell(path, {"cell.kind": "fake", "cell.table.objects": "[0, 0]"})
