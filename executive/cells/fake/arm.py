"""Ideal arm and tool of the fake cell, with attributes by which tests provoke failures."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from itertools import chain, pairwise
from typing import ParamSpec, TypeVar

import numpy as np

from executive.cell.arm import Goal, Motion, Task, reject_generator
from executive.cell.clock import STEP
from executive.cell.config import CellConfig
from executive.cell.layout import compute_travel_height, find_unreachable_places
from executive.cell.protocols import Clock
from executive.cell.workcell import KeyPath
from executive.cells.fake.fake_obstacles import Collision, FakeObstacles
from executive.cells.fake.world import FakeWorld
from executive.errors import Blocked, Fault, Unreachable
from executive.events import Emit
from executive.geometry import GRAVITY, Array, Pose, make_tool_down_pose
from executive.motion.arms import build_kinematics
from executive.motion.plans import Plan, PlanFactory

P = ParamSpec("P")
T = TypeVar("T")

MAX_REACH = 0.85
"""Maximum distance of the tool of the fake arm from the base [m]."""

MAX_TOOL_SPEED = 1.0
"""Speed of the fake tool outside of guarded motions, and maximum speed of guarded motions [m/s]."""

DEFAULT_BREAKAWAY_FORCE = 7.9
"""Breakaway force of the seals of the fake tool, unless a test changes it [N]."""

LOAD_NOISE = 1e-9
"""Amplitude of the noise of the load of the fake tool [N], so that the load cell does not seem broken."""


@dataclass(frozen=True, eq=False)
class FakeMotion:
    """A motion of the fake arm; `path` has one tool pose for each control step."""

    path: Sequence[Pose]

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return len(self.path) * STEP


class ImmediateExecutor(Executor):
    """Executor that calls each submitted function at once, in the thread of the caller."""

    def submit(self, function: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Call a function, and return its result or exception."""
        future: Future[T] = Future()
        try:
            future.set_result(function(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class FakeArm:
    """An arm without links, whose tool moves along straight lines at constant speed.

    The arm stops without braking. Its reach is limited, and neither the tool tip nor the lower end of the
    load may enter the table or the bins. Objects on the table are no obstacles.

    Args:
        world: The world that contains the held object.
        config: The cell file: named poses, travel height, bins and planning time.
        clock: Clock of the run.
        emit: Receives the events of the arm.

    Attributes:
        poses: Tool pose of each named pose; a run begins at `home`.
        tool_pose: Pose of the tool centre point; changed by `set_tool_pose`.
        tool_velocity: Velocity zero `(3,)` [m/s]: a released object falls straight down.
        collision: Description of the obstacle that stopped the last motion, or None.
        contact_point: Position of the tool `(x, y, z)` [m] at the last `next_obstacle`, or None.
        next_obstacle: Name of an obstacle in the middle of the next motion, or None; set by tests.
        commands: Names of the executed commands, `start` or `stop`, in order, for tests.
    """

    def __init__(self, world: FakeWorld, config: CellConfig, clock: Clock, emit: Emit) -> None:
        compute_tool_pose = build_kinematics(config).compute_tool_pose
        self.poses = {name: compute_tool_pose(np.radians(q)) for name, q in config.arm.poses_deg.items()}
        self.tool_pose, self.tool_velocity = self.poses["home"], np.zeros(3)
        self.collision: str | None = None
        self.contact_point: Sequence[float] | None = None
        self.next_obstacle: str | None = None
        self.commands: list[str] = []
        self._world = world
        self._travel_height = compute_travel_height(config)
        self._joint_count = config.arm.joint_count
        self._obstacles = FakeObstacles(config)
        worker = ImmediateExecutor()
        self._factory = PlanFactory(self._plan_motion, worker, clock, config.motion.planning_time, emit)
        self._path: list[Pose] = []
        self._half_pose_count = 0

    @property
    def q(self) -> Array:
        """Tool position [m], padded with zeros to the number of joints `(n,)`."""
        return np.concatenate([self.tool_pose.position, np.zeros(self._joint_count - 3)])

    @property
    def destination(self) -> Array:
        """Position of the tool `(3,)` [m] at the end of the running motion, or now if the arm is at rest."""
        return (self._path[-1] if self._path else self.tool_pose).position

    @property
    def at_rest(self) -> bool:
        """True while no motion runs."""
        return not self._path

    def describe_unreachable(self, goal: Goal) -> str:
        """Return a sentence if a goal is farther than `MAX_REACH` from the base, else ""."""
        try:
            check_reachable(np.array(goal.position))
        except Unreachable as error:
            return str(error)
        return ""

    def plan(self, goal: Goal | str, task: Task = Task()) -> Plan[FakeMotion]:
        """Begin to plan a motion to a goal or a named pose; a plan from `plan_ahead` is complete at once.

        The plan raises Unreachable for a goal beyond `MAX_REACH` from the base, and Blocked if the tool tip
        or the load would enter the table or a bin, even on the guarded part of the motion.
        """
        return self._factory.plan(self.destination, goal, task)

    def plan_ahead(self, goal: Goal | str, task: Task = Task()) -> None:
        """Plan the next motion, from the end of the running motion, before `plan` requests it."""
        self._factory.plan_ahead(self.destination, goal, task)

    def start(self, motion: Motion) -> None:
        """Begin to follow a motion.

        Raises:
            Fault: The arm is moving, or another arm planned the motion.
        """
        if not self.at_rest:
            raise Fault("the arm was started while it moves")
        reject_generator(motion)
        if not isinstance(motion, FakeMotion):
            raise Fault(f"the fake arm follows its own planned motions, not a {type(motion).__name__}")
        self.commands.append("start")
        self._world.is_commanded = True
        self._path = list(motion.path)
        self._half_pose_count = len(self._path) // 2
        self.collision = self.contact_point = None

    def set_tool_pose(self, pose: Pose) -> None:
        """Move the tool to a pose at once; the arm is then at rest."""
        self.tool_pose, self._path = pose, []

    def stop(self) -> None:
        """End the running motion without braking."""
        if self._path:
            self.commands.append("stop")
        self._path = []

    def stop_after_collision(self, message: str) -> None:
        """Stop the running motion and set `collision` to a message; do nothing if the arm is at rest."""
        if self._path:
            self.collision = message
            self.stop()

    def advance(self) -> None:
        """Move tool and held object to the next pose; stop before the object enters the table or a bin."""
        if self._path and (hit := self._find_load_collision(self._path[0])):
            self.stop_after_collision(f"{hit.part} ran into {hit.obstacle}, {hit.position_text}")
        elif self._path:
            self.tool_pose = self._path.pop(0)
            if self.next_obstacle is not None and len(self._path) <= self._half_pose_count:
                self.collision, self.next_obstacle = self.next_obstacle, None
                self.contact_point = self.tool_pose.position.tolist()
                self.stop()
        if (held := self._world.held_object) is not None:
            height = self._world.classes[held.label].height
            held.position = self.tool_pose.position - np.array([0.0, 0.0, height / 2])

    def _find_load_collision(self, pose: Pose) -> Collision | None:
        """Return the collision of the held object on the way to `pose`, or None.

        A plan for a task without a load has not checked the held object.
        """
        held = self._world.held_object
        if held is None:
            return None
        tip_positions = np.array([self.tool_pose.position, pose.position])
        return self._obstacles.find_collision(tip_positions, self._world.classes[held.label])

    def _plan_motion(self, start: Array, goal: Goal | str, task: Task) -> FakeMotion:
        load = task.load.object_class if task.load else None
        message = ""
        for path in self._generate_paths(start, goal):
            tip_positions = np.array([start, *(pose.position for pose in path)])
            collision = self._obstacles.find_collision(tip_positions, load)
            if collision is None:
                return FakeMotion(path)
            part, obstacle, depth, position_text = collision
            message = f"the motion would bring {part} {depth:.3f} m into {obstacle}, {position_text}"
        raise Blocked(message)

    def _generate_paths(self, start: Array, goal: Goal | str) -> Iterator[list[Pose]]:
        """Yield paths: for a named pose a straight path, then for any goal a path at travel height."""
        raised_position = np.array([*start[:2], max(start[2], self._travel_height)])
        if isinstance(goal, str):
            end = self.poses[goal]
            end_position = guarded_start = end.position
            rotation, speed = end.rotation, MAX_TOOL_SPEED
            yield [*_make_straight_path(start, end_position, rotation, MAX_TOOL_SPEED)[:-1], end]
        else:
            end_position = np.array(goal.position)
            check_reachable(end_position)
            guarded_start = np.array([*end_position[:2], end_position[2] + goal.guarded_length])
            rotation = make_tool_down_pose(end_position, goal.yaw or 0.0).rotation
            speed = min(goal.guarded_speed, MAX_TOOL_SPEED)
        position_over_goal = np.array([*end_position[:2], max(guarded_start[2], self._travel_height)])
        fast_lines = pairwise([start, raised_position, position_over_goal, guarded_start])
        fast_parts = [_make_straight_path(*line, rotation, MAX_TOOL_SPEED) for line in fast_lines]
        yield [*chain(*fast_parts), *_make_straight_path(guarded_start, end_position, rotation, speed)]


class FakeTool:
    """A suction cup that seals on every touched object, unless `can_seal` returns False.

    Args:
        world: The world with the objects.
        get_tip_position: Returns the position of the tool tip `(3,)` [m].
        load_std: Declared standard deviation of a reading of `load` [N].

    Attributes:
        can_seal: Function that returns True if the cup can seal on the touched object; set by tests.
        breakaway_force: Force that every seal withstands [N].
        load_error: Error of `load` [N]; set by tests.
    """

    def __init__(self, world: FakeWorld, get_tip_position: Callable[[], Array], load_std: float) -> None:
        self._world = world
        self._get_tip_position = get_tip_position
        self.load_std = load_std
        self.load_error = 0.0
        self._noise = LOAD_NOISE
        self.can_seal: Callable[[], bool] = lambda: True
        self.breakaway_force = DEFAULT_BREAKAWAY_FORCE

    @property
    def touching(self) -> bool:
        """True while the cup touches an object or the table."""
        tip_position = self._get_tip_position()
        return self._world.find_touched_object(tip_position) is not None or float(tip_position[2]) <= 0.0

    @property
    def holding(self) -> bool:
        """True while the tool holds an object."""
        return self._world.held_object is not None

    @property
    def holding_force(self) -> float:
        """Breakaway force of the seal [N]; 0 while the tool holds nothing."""
        return self.breakaway_force if self.holding else 0.0

    @property
    def load(self) -> float:
        """Weight of the held object by the mass of its class, plus `load_error` and alternating noise [N]."""
        self._noise = -self._noise
        held = self._world.held_object
        force = self._world.classes[held.label].mass * GRAVITY if held else 0.0
        return force + self.load_error + self._noise

    def close(self) -> None:
        """Seal the cup on the touched object."""
        self._world.is_commanded = True
        fake_object = self._world.find_touched_object(self._get_tip_position())
        if fake_object is not None and self.can_seal():
            self._world.held_object, fake_object.is_dropped = fake_object, False

    def open(self) -> None:
        """Release the held object; it falls straight down."""
        self._world.is_commanded = True
        self._release()

    def break_seal(self) -> None:
        """Break the seal: the held object falls straight down, and rolls off other objects and bin walls."""
        fake_object = self._world.held_object
        self._release()
        if fake_object is not None:
            fake_object.is_dropped = True
            self._world.roll_to_free_position(fake_object)
            fake_object.rest_positions[-1] = fake_object.position.copy()

    def _release(self) -> None:
        fake_object, self._world.held_object = self._world.held_object, None
        if fake_object is not None:
            fake_object.position[2] = self._world.classes[fake_object.label].height / 2
            fake_object.rest_positions.append(fake_object.position.copy())


def check_reachable(position: Array) -> None:
    """Check that the fake tool reaches a position `(3,)` [m].

    Raises:
        Unreachable: The position is farther than `MAX_REACH` from the base.
    """
    distance = float(np.linalg.norm(position))
    if distance > MAX_REACH:
        raise Unreachable(f"the goal is {distance:.2f} m from the base, the arm reaches {MAX_REACH:.2f} m")


def find_places_out_of_reach(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each bin beyond `MAX_REACH`, and for a safe place beyond `MAX_REACH`."""
    height = compute_travel_height(config)
    return find_unreachable_places(config, lambda place, _: check_reachable(np.array([*place, height])))


def _make_straight_path(start: Array, end: Array, rotation: Array, speed: float) -> list[Pose]:
    """Return the tool pose after each control step from `start` to `end` `(3,)` [m] at `speed` [m/s]."""
    count = math.ceil(float(np.linalg.norm(end - start)) / speed / STEP)
    return [Pose(rotation, start + (end - start) * (i + 1) / count) for i in range(count)]
