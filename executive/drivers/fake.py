"""Work cell without physics: world, arm, tool, camera and detectors, with the real ledger and localizer."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from executive.cell.arm import Goal, Motion
from executive.cell.config import CellConfig, DetectorConfig
from executive.cell.frame import Box, Detection, Frame
from executive.cell.objects import BIN_THICKNESS, Bin, ObjectClass
from executive.cell.protocols import Clock, Ledger, Routes
from executive.cell.tools import ToolModel
from executive.cell.workcell import CellOptions, TrueObject
from executive.drivers.world_log import LogFile
from executive.errors import InputError, Unavailable
from executive.events import Emit, discard_event
from executive.geometry import GRAVITY, Array, Pose
from executive.mission.cell_file import load_cell
from executive.motion.arms import build_planning_kinematics, find_arm_errors, find_places_out_of_reach
from executive.motion.configurations import find_configuration_pairs
from executive.motion.planner import PlanningArm
from executive.motion.straight_paths import StraightMotion, plan_straight_motion
from executive.perception.camera_model import MountedCamera, compute_hull_mask
from executive.perception.detectors.requests import PendingSearch
from executive.perception.localization import CellLocalizer
from executive.station.view_check import find_view_errors
from executive.station.without_hardware import CellWithoutHardware, SilentOperator
from executive.text.validate import KeyPath
from executive.text.yaml_files import get_shipped_folder

SHIPPED_ROUTES = {"cube": ("red_bin",), "sphere": ("blue_bin",), "duck": ("yellow_bin",)}
"""Permitted bins of each class of the shipped cells."""
DEFAULT_CONFIDENCE = 0.9
"""Confidence of the detections of a fake detector, unless the threshold in the cell file is higher."""
MAX_GRIP_OFFSET = 0.012
"""Maximum horizontal distance between the tool and the contact points of an object for a grip [m]."""
TOUCH_DISTANCE = 0.002
"""Maximum vertical distance between the tool and the top of an object for contact [m]."""


@dataclass(eq=False)
class FakeWorld:
    """Objects and bins of a fake cell.

    Attributes:
        classes: Classes of the objects, by label.
        bins: The bins of the cell.
        objects: The objects, in the order in which they were added.
        removed_objects: The objects that were removed from the world.
        held_object: The object that the tool holds, or None.
        is_commanded: True if arm or tool has received a command since the last control step.
    """

    classes: Mapping[str, ObjectClass]
    bins: Collection[Bin] = ()
    objects: list[TrueObject] = field(default_factory=list)
    removed_objects: list[TrueObject] = field(default_factory=list)
    held_object: TrueObject | None = None
    is_commanded: bool = False

    def put(self, label: str, x: float, y: float) -> TrueObject:
        """Put a new object of a class on the table, with its centre at `x` and `y` [m], and return it."""
        position = np.array([x, y, self.classes[label].height / 2])
        body = len(self.objects) + len(self.removed_objects)
        fake_object = TrueObject(label, Pose.of(position), body, [position.copy()])
        self.objects.append(fake_object)
        return fake_object

    def remove(self, fake_object: TrueObject) -> None:
        """Remove an object that is not held."""
        self.objects.remove(fake_object)
        self.removed_objects.append(fake_object)

    def release(self, *, is_dropped: bool = False) -> None:
        """Let the held object fall straight down; if it is dropped, it rolls to a free position."""
        if (fake_object := self.held_object) is None:
            return
        self.held_object = None
        fake_object.position[2] = self.classes[fake_object.label].height / 2
        fake_object.is_dropped = is_dropped
        if is_dropped:
            self._roll_to_free_position(fake_object)
        fake_object.rest_positions.append(fake_object.position.copy())

    def _roll_to_free_position(self, fake_object: TrueObject) -> None:
        """Move an object off each overlapping object in turn, or from the wall of a bin into the bin."""
        radius = self.classes[fake_object.label].radius
        for obstacle in self.objects if self.find_bin(fake_object) is None else ():
            min_distance = radius + self.classes[obstacle.label].radius
            direction = fake_object.position[:2] - obstacle.position[:2]
            distance = float(np.linalg.norm(direction))
            if obstacle is not fake_object and distance < min_distance:
                direction = direction / distance if distance else np.array((1.0, 0.0))
                fake_object.position[:2] = obstacle.position[:2] + min_distance * direction
        if (bin := self.find_bin(fake_object)) is not None:
            max_offset = np.maximum(bin.size[:2] / 2 - radius, 0.0)
            offset = fake_object.position[:2] - bin.position[:2]
            fake_object.position[:2] = bin.position[:2] + np.clip(offset, -max_offset, max_offset)

    def find_bin(self, fake_object: TrueObject) -> Bin | None:
        """Return the bin that contains an object; if there is none, the bin on whose wall the object lies."""
        wall_margin = BIN_THICKNESS + self.classes[fake_object.label].radius / 2
        places = product((0.0, wall_margin), self.bins)
        return next((bin for margin, bin in places if bin.contains(fake_object.position, margin)), None)

    def find_touched_object(self, tip_position: Array) -> TrueObject | None:
        """Return the object that a tool at `tip_position` `(3,)` [m] touches from above, or None."""
        for fake_object in self.objects:
            object_class = self.classes[fake_object.label]
            distance = float(np.linalg.norm(fake_object.position[:2] - tip_position[:2]))
            offset = abs(distance - object_class.contact_radius)
            gap = abs(float(fake_object.position[2]) + object_class.height / 2 - tip_position[2])
            is_touched = offset <= MAX_GRIP_OFFSET and gap <= TOUCH_DISTANCE
            if is_touched and fake_object is not self.held_object:
                return fake_object
        return None


@dataclass(eq=False)
class FakeTool:
    """A tool that grips every touched object that its model can hold, unless `can_hold` returns False.

    Attributes:
        can_hold: Function that returns True if the tool can hold the touched object; set by tests.
        force: Force with which the tool holds every object [N].
        load_error: Error of `load` [N]; set by tests.
    """

    world: FakeWorld
    get_tip_position: Callable[[], Array]
    model: ToolModel
    can_hold: Callable[[], bool] = field(default=lambda: True)
    force: float = 7.9
    load_error: float = 0.0
    _noise: float = 1e-9  # It alternates, so that the load cell does not seem broken.

    @property
    def touching(self) -> bool:
        tip_position = self.get_tip_position()
        return self.world.find_touched_object(tip_position) is not None or float(tip_position[2]) <= 0.0

    @property
    def holding(self) -> bool:
        return self.world.held_object is not None

    @property
    def holding_force(self) -> float:
        return self.force if self.holding else 0.0

    @property
    def load_std(self) -> float:
        return self.model.load_std

    @property
    def load(self) -> float:
        self._noise = -self._noise
        held = self.world.held_object
        force = self.world.classes[held.label].mass * GRAVITY if held else 0.0
        return force + self.load_error + self._noise

    def close(self) -> None:
        self.world.is_commanded = True
        touched = self.world.find_touched_object(self.get_tip_position())
        if touched is None or self.model.explain_unsuitable(self.world.classes[touched.label]):
            return
        if self.can_hold():
            touched.is_dropped = False
            self.world.held_object = touched

    def open(self) -> None:
        self.world.is_commanded = True
        self.world.release()

    def lose_grip(self) -> None:
        """Drop the held object; it rolls off other objects and bin walls."""
        self.world.release(is_dropped=True)


class FakeCamera(MountedCamera):
    """The camera of a cell file, with blank images.

    Attributes:
        occluded_regions: Regions of the image that frames mark as occluded [pixel]; set by tests.
    """

    def __init__(self, config: CellConfig, arm: FakeArm, clock: Clock, ledger: Ledger) -> None:
        name, camera = next(iter(config.cameras.items()))
        X_TF = Pose.of((0.0, 0.0, -config.tool.length))  # pose of the flange F in the frame T of the tool
        super().__init__(name, camera, lambda: arm.tool_pose @ X_TF, clock, lambda: ledger.change_count)
        self.occluded_regions: list[Box] = []
        self._corners = np.array([(x, y, 0.0) for x in config.table.x for y in config.table.y])

    def sees_table(self) -> bool:
        return compute_hull_mask(self._corners, self.matrix, self._compute_pose(), self._size) is not None

    def _capture_images(self) -> tuple[NDArray[np.uint8], None]:
        return np.zeros((self.config.height, self.config.width, 3), dtype=np.uint8), None

    def _compute_visibility_mask(self, X_WC: Pose) -> NDArray[np.bool_]:
        del X_WC
        mask = np.ones((self.config.height, self.config.width), dtype=bool)
        for left, top, right, bottom in self.occluded_regions:
            mask[int(top) : int(bottom), int(left) : int(right)] = False
        return mask


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
        self.request_count += 1
        left, top, right, bottom = self.get_view_region(view)
        true_detections = []
        for fake_object in self.world.objects:
            x, y, depth = frame.matrix @ frame.X_WC.inverse().apply(fake_object.position)
            column = x / depth
            row = y / depth
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
        answer_time = self.clock.now + self.config.latency
        return PendingSearch(future, answer_time, self.clock, self.name, self.config.error_rates)


def put_random_objects(world: FakeWorld, config: CellConfig, seed: int) -> None:
    """Put objects of random classes on random grid points, as many as the cell file permits."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(*config.table.objects, endpoint=True))
    points = list_grid_points(config)
    for index in rng.permutation(len(points))[:count]:
        world.put(str(rng.choice(list(config.objects))), *points[index])


def list_grid_points(config: CellConfig) -> list[tuple[float, float]]:
    """Return the points on the table at which objects can lie beside each other [m]."""
    distance = 2 * max(object_class.radius for object_class in config.objects.values()) + config.table.gap
    sides = config.table.x, config.table.y
    xs, ys = (np.linspace(low, high, 1 + int((high - low) / distance)) for low, high in sides)
    return [(float(x), float(y)) for x in xs for y in ys]


class FakeArm(PlanningArm[StraightMotion]):
    """An arm that moves on straight joint paths, stops without braking, and never hits an obstacle by itself.

    Attributes:
        q: Joint positions `(n,)` [rad].
        poses: Joint positions `(n,)` [rad] of each named pose; a run begins at `home`.
        tool_velocity: Velocity zero `(3,)` [m/s]: a released object falls straight down.
        collision: Description of the obstacle that stopped the last motion, or None.
        contact_point: Position of the tool `(x, y, z)` [m] at the last `next_obstacle`, or None.
        next_obstacle: Name of an obstacle in the middle of the next motion, or None; set by tests.
        commands: Names of the executed commands, `start` or `stop`, in order, for tests.
    """

    q = np.zeros(0)

    def __init__(self, world: FakeWorld, config: CellConfig, clock: Clock, emit: Emit) -> None:
        kinematics = build_planning_kinematics(config)
        plan_motion = functools.partial(plan_straight_motion, config, kinematics)
        super().__init__(config, kinematics, plan_motion, clock, emit)
        self.q = self.poses["home"]
        self.tool_velocity = np.zeros(3)
        self.next_obstacle: str | None = None
        self.commands: list[str] = []
        self._world = world
        self._tool_model = config.tool
        self._path: list[Array] = []
        self._half_length = 0

    @property
    def at_rest(self) -> bool:
        return not self._path

    @property
    def _end_q(self) -> Array:
        return self._path[-1] if self._path else self.q

    def start(self, motion: Motion) -> None:
        self._path = list(self._require_own_motion(motion, StraightMotion).qs)
        self._half_length = len(self._path) // 2
        self.commands.append("start")
        self._world.is_commanded = True
        self.collision = None
        self.contact_point = None

    def set_tool_position(self, position: Array) -> None:
        """Move the tool, which then points down, to a position `(3,)` [m] at once."""
        x, y, z = map(float, position)
        self.q = find_configuration_pairs(self.kinematics, Goal((x, y, z)), 0.0, self.q).lower_qs[0]
        self._path = []

    def stop(self) -> None:
        if self._path:
            self.commands.append("stop")
        self._path = []

    def stop_after_collision(self, message: str) -> None:
        if self._path:
            self.collision = message
            self.stop()

    def advance(self) -> None:
        if not self._path:
            return
        self.q = self._path.pop(0)
        if (held := self._world.held_object) is not None:
            object_class = self._world.classes[held.label]
            depth = self._tool_model.get_hold_height(object_class) - object_class.height / 2
            held.position[:] = self.tool_pose.position - np.array([0.0, 0.0, depth])
        if self.next_obstacle is not None and len(self._path) <= self._half_length:
            self.contact_point = self.tool_pose.position.tolist()
            self.stop_after_collision(self.next_obstacle)
            self.next_obstacle = None


class FakeCell(CellWithoutHardware):
    """The cell of a cell file without physics; by default the shipped cell `overhead` without objects.

    The arm moves on straight joint paths, the tool holds every object that its kind can hold, and every
    detector finds all objects.

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
        clock = self.cell.clock
        self.ledger = self.accounts
        self.world = FakeWorld(self.cell.classes, self.cell.bins.values())
        put_random_objects(self.world, config, seed)
        self.arm = FakeArm(self.world, config, clock, emit)
        self.tool = FakeTool(self.world, lambda: self.arm.tool_pose.position, config.tool)
        self.camera = FakeCamera(config, self.arm, clock, self.ledger)
        self.detectors = {
            name: FakeDetector(name, detector, self.world, clock, self.camera.get_view_box)
            for name, detector in config.detectors.items()
        }
        self.detector = next(iter(self.detectors.values()))
        self._log: LogFile | None = None
        self._log_length = 0
        if options.resume is not None:
            self._restore_state(options.resume.log_path)
            self.log_to(options.resume.log_path)
        localizer = CellLocalizer("plane", self.cell.classes, self.cell.bins.values())
        self._connect(options, self.arm, self.tool, self.camera, self.detectors, localizer)

    @staticmethod
    def check(config: CellConfig, cell_folder: Path) -> Iterable[tuple[KeyPath, str]]:
        del cell_folder
        if arm_errors := tuple(find_arm_errors(config)):
            yield from arm_errors
            return
        yield from find_places_out_of_reach(config)
        place_count = len(list_grid_points(config))
        if config.table.objects[1] > place_count:
            message = f"the table has room for {place_count} objects, not for {config.table.objects[1]}"
            yield ("table", "objects"), message
        yield from find_view_errors(config)

    @staticmethod
    def labels(config: CellConfig, cell_folder: Path) -> Mapping[str, tuple[str, ...] | None]:
        del cell_folder
        return dict.fromkeys(config.detectors)

    def log_to(self, path: Path) -> None:
        self._log = LogFile(path, "the state of the world")
        self.log_state()

    def log_state(self) -> None:
        if self._log is None:
            return
        held = self.world.held_object
        index = None if held is None else self.world.objects.index(held)
        objects = [_encode_object(each) for each in self.world.objects]
        removed_objects = [_encode_object(each) for each in self.world.removed_objects]
        state = [self.steps, self.last_command_step, self.arm.q, index, objects, removed_objects]
        text = json.dumps(state, default=np.ndarray.tolist).encode()
        # Blanks pad the text to the length of the longest state so far, to overwrite all old text.
        self._log_length = max(self._log_length, len(text))
        self._log.write(text.ljust(self._log_length), 0)

    def _restore_state(self, path: Path) -> None:
        try:
            steps, last_command_step, q, held, objects, removed_objects = json.loads(path.read_bytes())
            self.steps = int(steps)
            self.last_command_step = int(last_command_step)
            self.arm.q = np.array(q, dtype=float).reshape(self.arm.q.shape)
            restored = [_decode_object(body, *each) for body, each in enumerate(objects + removed_objects)]
            self.world.objects = restored[: len(objects)]
            self.world.removed_objects = restored[len(objects) :]
            self.world.held_object = None if held is None else self.world.objects[held]
        except (OSError, ValueError, TypeError, LookupError, RecursionError) as error:
            raise InputError(f'the world in "{path}" is damaged: {error}; run the mission again') from error

    def advance(self) -> None:
        if self.world.is_commanded:
            self.last_command_step = self.steps
            self.world.is_commanded = False
        self.arm.advance()
        super().advance()
        self.log_state()

    def _list_final_objects(self) -> Iterator[TrueObject]:
        for each in (*self.world.objects, *self.world.removed_objects):
            bin = self.world.find_bin(each)
            is_held = each is self.world.held_object
            is_removed = each in self.world.removed_objects
            yield replace(each, bin=bin.name if bin else "", is_held=is_held, is_removed=is_removed)

    def close(self) -> None:
        self.arm.close()
        if self._log is not None:
            self._log.close()


def _encode_object(fake_object: TrueObject) -> list[object]:
    """Return the arguments of `_decode_object` after the number, for the log."""
    return [fake_object.label, fake_object.is_dropped, fake_object.position, *fake_object.rest_positions]


def _decode_object(body: int, label: object, is_dropped: object, *positions: object) -> TrueObject:
    """Return an object from the log: `positions` are the current position and the rest positions."""
    position, *rest_positions = np.array(positions, dtype=float).reshape(-1, 3)
    return TrueObject(str(label), Pose.of(position), body, rest_positions, bool(is_dropped))


@functools.cache
def load_empty_cell() -> CellConfig:
    """Return the shipped cell `overhead` as a fake cell without objects, for tests of single skills."""
    path = get_shipped_folder() / "cells" / "overhead.yaml"
    return load_cell(path, {"cell.kind": "fake", "cell.table.objects": "[0, 0]"})
