"""Driver of a cell without physics: arm, tool and camera, for tests and rehearsals of missions."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from executive.cell.arm import Goal, Motion, MotionGuard
from executive.cell.config import CellConfig, ObjectConfig
from executive.cell.device_config import STEP
from executive.cell.devices import DEFAULT_ROLE, CameraImage, DriverOptions, StepClock, TrueObject, WallClock
from executive.cell.frame import Box, Detection
from executive.cell.protocols import Clock
from executive.cell.tools import ToolModel
from executive.drivers.fake_world import (
    FakeWorld,
    decode_object,
    encode_object,
    list_grid_points,
    put_random_objects,
)
from executive.drivers.world_log import LogFile
from executive.errors import InputError
from executive.geometry import GRAVITY, Array, Pose
from executive.motion.configurations import find_configuration_pairs
from executive.motion.joints import build_planning_kinematics
from executive.perception.camera_model import compute_calibration, project
from executive.text.files import MAX_RECORD_SIZE, read_file
from executive.text.validate import KeyPath

MAX_STEP_ERROR = 1e-6
"""Maximum rounding error of a number of steps."""


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
    _opening: float = 0.0
    _noise: float = 1e-9  # It alternates, so that the load cell does not seem broken.

    @property
    def touching(self) -> bool:
        tip_position = self.get_tip_position()
        is_on_object = not self.model.max_opening and self.find_object() is not None
        return is_on_object or float(tip_position[2]) <= 0.0

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

    @property
    def opening(self) -> float:
        held = self.world.held_object
        return self.model.compute_grip_opening(self.world.classes[held.label]) if held else self._opening

    def find_object(self) -> TrueObject | None:
        """Return the object that the tool touches or has between its fingers, or None."""
        return self.world.find_touched_object(self.get_tip_position(), self.model.get_hold_height)

    def close(self) -> None:
        self.world.is_commanded = True
        self._opening = 0.0
        touched = self.find_object()
        if touched is None or self.model.explain_unsuitable(self.world.classes[touched.label]):
            return
        if self.can_hold():
            touched.is_dropped = False
            self.world.held_object = touched

    def open(self, opening: float = 0.0) -> None:
        self.world.is_commanded = True
        self._opening = opening or self.model.max_opening
        self.world.release()

    def lose_grip(self) -> None:
        """Drop the held object; it rolls off other objects and bin walls."""
        self.world.release(is_dropped=True)


class FakeCamera:
    """The camera of a cell file, with blank images and the true detections of all objects on the table.

    Attributes:
        occluded_regions: Regions of the image that the images mark as occluded [pixel]; set by tests.
    """

    def __init__(self, config: CellConfig, world: FakeWorld, arm: FakeArm, clock: Clock) -> None:
        self.occluded_regions: list[Box] = []
        self._config = next(iter(config.cameras.values()))
        self._matrix, self._X_MC = compute_calibration(self._config)
        # T is the frame of the tool, F the frame of the flange.
        self._X_TF = Pose.of((0.0, 0.0, -config.tool.length))
        self._shows_outlines = config.needs_yaw
        self._world = world
        self._arm = arm
        self._clock = clock

    def capture(self) -> CameraImage:
        size = (self._config.height, self._config.width)
        visible = np.ones(size, dtype=bool)
        for left, top, right, bottom in self.occluded_regions:
            visible[int(top) : int(bottom), int(left) : int(right)] = False
        detections = tuple(self._find_true_detections())
        return CameraImage(np.zeros((*size, 3), np.uint8), None, self._clock.now, visible, detections)

    def _find_true_detections(self) -> Iterator[Detection]:
        X_WC = self._X_MC
        if self._config.mount == "wrist":
            X_WC = self._arm.tool_pose @ self._X_TF @ self._X_MC
        for fake_object in self._world.objects:
            x, y, depth = self._matrix @ X_WC.inverse().apply(fake_object.position)
            if depth <= 0 or fake_object is self._world.held_object:
                continue
            object_class = self._world.classes[fake_object.label]
            if self._shows_outlines and object_class.yaw_symmetry:
                pixels = project(self._matrix, X_WC, self._world.compute_outline(fake_object))
                box = (*pixels.min(axis=0).tolist(), *pixels.max(axis=0).tolist())
                yield Detection(object_class.label, 1.0, box, outline=tuple(map(tuple, pixels.tolist())))
                continue
            column = x / depth
            row = y / depth
            half_side = self._matrix[0, 0] / depth * object_class.radius
            box = (column - half_side, row - half_side, column + half_side, row + half_side)
            yield Detection(object_class.label, 1.0, box)


class FakeArm:
    """An arm that follows motions exactly, stops without braking, and never hits an obstacle by itself.

    Attributes:
        q: Joint positions `(n,)` [rad]; a run begins at `home`.
        qd: Joint velocities zero `(n,)` [rad/s]: a released object falls straight down.
        collision: Description of the obstacle that stopped the last motion, or None.
        contact_point: Position of the tool `(x, y, z)` [m] at the last `next_obstacle`, or None.
        next_obstacle: Name of an obstacle in the middle of the next motion, or None; set by tests.
        commands: Names of the executed commands, `start` or `stop`, in order, for tests.
        tool: The tool, whose sensors trigger guards.
    """

    tool: FakeTool

    def __init__(self, world: FakeWorld, config: CellConfig) -> None:
        self.q = np.radians(config.arm.poses_deg["home"])
        self.qd = np.zeros_like(self.q)
        self.collision: str | None = None
        self.contact_point: Sequence[float] | None = None
        self.next_obstacle: str | None = None
        self.commands: list[str] = []
        self._kinematics = build_planning_kinematics(config)
        self._q_of_pose = self.q
        self._tool_pose = self._kinematics.compute_tool_pose(self.q)
        self._world = world
        self._tool_model = config.tool
        self._path: list[Array] = []
        self._half_length = 0
        self._guard = MotionGuard()
        self._has_been_free = False
        """True if the tool has touched nothing at some time since the start of the motion."""

    @property
    def at_rest(self) -> bool:
        return not self._path

    @property
    def end_q(self) -> Array:
        return self._path[-1] if self._path else self.q

    @property
    def tool_pose(self) -> Pose:
        """Pose of the tool centre point in the world."""
        # In a control step, several devices need the pose of the same joint positions.
        if self._q_of_pose is not self.q:
            self._tool_pose = self._kinematics.compute_tool_pose(self.q)
            self._q_of_pose = self.q
        return self._tool_pose

    def execute(self, motion: Motion, guard: MotionGuard) -> None:
        step_count = math.ceil(motion.duration / STEP - MAX_STEP_ERROR)
        self._path = [motion.state_at((number + 1) * STEP).q for number in range(step_count)]
        self._half_length = len(self._path) // 2
        self._guard = guard
        self._has_been_free = not (guard.touch and (self.tool.touching or self._world.is_load_on_table()))
        self.commands.append("start")
        self._world.is_commanded = True
        self.collision = None
        self.contact_point = None

    def set_tool_position(self, position: Array) -> None:
        """Move the tool, which then points down, to a position `(3,)` [m] at once."""
        x, y, z = map(float, position)
        self.q = find_configuration_pairs(self._kinematics, Goal((x, y, z)), 0.0, self.q).lower_qs[0]
        self._path = []

    def stop(self) -> None:
        if self._path:
            self.commands.append("stop")
        self._path = []

    def stop_after_collision(self, message: str) -> None:
        """Set `collision` to a message, and stop; do nothing at rest."""
        if self._path:
            self.collision = message
            self.stop()

    def advance(self) -> None:
        """Move the arm by one step of `STEP`."""
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
        if self._guard.touch and self._path:
            is_touching = self.tool.touching or self._world.is_load_on_table()
            if self._has_been_free and is_touching:
                self.stop()
            self._has_been_free |= not is_touching
        if self._guard.lost_grip and not self.tool.holding:
            self.stop()


class FakeDriver:
    """The devices of a cell without physics; implements `executive.cell.devices.Driver`.

    The arm follows motions exactly, the tool holds what its kind can hold, and images contain the true
    detections of all objects.

    Args:
        config: The cell file.
        options: Seed of the objects.
        clock: Clock of the devices; None: simulated time.

    Attributes:
        world: Objects and bins.
        arm, tool, camera: The devices.
        last_command_tick: Tick of the last start of a motion or command to the tool.
    """

    is_rehearsal = True

    @staticmethod
    def compute_mass(section: ObjectConfig) -> float:
        """Return the mass of an object [kg]; without a declared mass, the default mass."""
        return section.build_class("").mass

    def __init__(
        self,
        config: CellConfig,
        options: DriverOptions = DriverOptions(),
        clock: StepClock | WallClock | None = None,
    ) -> None:
        classes = config.build_classes()
        self.world = FakeWorld(classes, config.build_bins().values())
        put_random_objects(self.world, config, options.seed)
        self.clock = clock or StepClock(config.clock.step)
        self.clock.on_tick = self._advance
        self.arm = FakeArm(self.world, config)
        self.tool = FakeTool(self.world, lambda: self.arm.tool_pose.position, config.tool)
        self.arm.tool = self.tool
        self.camera = FakeCamera(config, self.world, self.arm, self.clock)
        self.arms = {DEFAULT_ROLE: self.arm}
        self.tools = {DEFAULT_ROLE: self.tool}
        self.cameras = dict.fromkeys(config.cameras, self.camera)
        self.last_command_tick = 0
        self._step_count = 0
        self._log: LogFile | None = None
        self._log_length = 0

    @staticmethod
    def check(config: CellConfig, cell_folder: Path) -> Iterable[tuple[KeyPath, str]]:
        """Yield an error if the table has no room for the objects."""
        del cell_folder
        place_count = len(list_grid_points(config))
        if config.table.objects[1] > place_count:
            message = f"the table has room for {place_count} objects, not for {config.table.objects[1]}"
            yield ("table", "objects"), message

    def _advance(self) -> None:
        """Move the arm until the time of the clock."""
        if self.world.is_commanded:
            self.last_command_tick = self.clock.tick_count - 1
            self.world.is_commanded = False
        due_step_count = round(self.clock.now / STEP)
        for _ in range(due_step_count - self._step_count):
            self.arm.advance()
        self._step_count = due_step_count
        self.log_state()

    def log_to(self, path: Path) -> None:
        self._log = LogFile(path, "the state of the world")
        self.log_state()

    def log_state(self) -> None:
        """Write the state of the world to the log."""
        if self._log is None:
            return
        held = self.world.held_object
        index = None if held is None else self.world.objects.index(held)
        objects = [encode_object(each) for each in self.world.objects]
        removed_objects = [encode_object(each) for each in self.world.removed_objects]
        forgotten_count = self.world.forgotten_count
        ticks = [self.clock.tick_count, self.last_command_tick]
        state = [*ticks, self.arm.q, index, objects, removed_objects, forgotten_count]
        text = json.dumps(state, default=np.ndarray.tolist).encode()
        # Blanks pad the text to the length of the longest state so far, to overwrite all old text.
        self._log_length = max(self._log_length, len(text))
        self._log.write(text.ljust(self._log_length), 0)

    def rebuild(self, path: Path) -> int:
        try:
            state = json.loads(read_file(path, MAX_RECORD_SIZE))
            ticks, last_command_tick, q, held, objects, removed_objects, forgotten_count = state
            self.clock.tick_count = int(ticks)
            self.last_command_tick = int(last_command_tick)
            self.arm.q = np.array(q, dtype=float).reshape(self.arm.q.shape)
            restored = [decode_object(body, *each) for body, each in enumerate(objects + removed_objects)]
            self.world.objects = restored[: len(objects)]
            self.world.removed_objects = restored[len(objects) :]
            self.world.forgotten_count = int(forgotten_count)
            self.world.held_object = None if held is None else self.world.objects[held]
        except (ValueError, TypeError, LookupError, RecursionError, OverflowError) as error:
            raise InputError(f'the world in "{path}" is damaged: {error}; run the mission again') from error
        self._step_count = round(self.clock.now / STEP)
        self.log_to(path)
        return self.clock.tick_count

    def list_objects(self) -> Sequence[TrueObject]:
        return list(self.world.objects)

    def list_final_objects(self) -> Iterator[TrueObject]:
        for each in (*self.world.objects, *self.world.removed_objects):
            bin = self.world.find_bin(each)
            is_held = each is self.world.held_object
            is_removed = each in self.world.removed_objects
            yield replace(each, bin=bin.name if bin else "", is_held=is_held, is_removed=is_removed)

    def find_held_object(self) -> TrueObject | None:
        return self.world.held_object

    @property
    def forgotten_count(self) -> int:
        return self.world.forgotten_count

    def remove_object(self, true_object: TrueObject, *, is_counted: bool = True) -> None:
        self.world.remove(true_object, is_counted=is_counted)

    def move_object(self, true_object: TrueObject, displacement: tuple[float, float]) -> None:
        true_object.position[:2] += displacement
        true_object.rest_positions.append(true_object.position.copy())

    def drop_held_object(self) -> None:
        self.tool.lose_grip()

    def collide(self, message: str) -> None:
        self.arm.stop_after_collision(message)

    def close(self) -> None:
        if self._log is not None:
            self._log.close()
