"""Ideal arm and tool of the fake cell; tests can make them fail."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

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
from executive.events import Emit, discard_event
from executive.geometry import Array, Pose, make_tool_down_pose
from executive.motion.arms import build_kinematics
from executive.motion.plans import Plan, PlanFactory

MAX_REACH = 0.85
"""Maximum distance of the tool of the fake arm from the base [m]."""

MAX_TOOL_SPEED = 1.0
"""Maximum tool speed of the fake arm, and its speed outside of guarded motions [m/s]."""

DEFAULT_BREAKAWAY_FORCE = 7.9
"""Breakaway force of the seals of the fake tool, unless a test changes it [N]."""


@dataclass(frozen=True, eq=False)
class FakeMotion:
    """A motion of the fake arm; `path` has one tool pose for each control step."""

    path: Sequence[Pose]

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return len(self.path) * STEP


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
        next_obstacle: Obstacle that stops the arm in the middle of its next motion, or None; set by tests.
        commands: Names of the executed commands, `start` or `stop`, in order, for tests.
    """

    def __init__(
        self, world: FakeWorld, config: CellConfig, clock: Clock, emit: Emit = discard_event
    ) -> None:
        self.poses = compute_named_poses(config)
        self.next_obstacle: str | None = None
        self.commands: list[str] = []
        self._world = world
        self._height = compute_travel_height(config)
        self._joint_count = config.arm.joint_count
        self._obstacles = FakeObstacles(config)
        self._plans = PlanFactory(self._plan_motion, clock, config.motion.planning_time, emit)
        self._tool = self.poses["home"]
        self._path: list[Pose] = []
        self._half_length = 0
        self._met_obstacle: str | None = None

    @property
    def q(self) -> Array:
        """Tool position [m], padded with zeros to the number of joints `(n,)`."""
        return np.concatenate([self._tool.position, np.zeros(self._joint_count - 3)])

    @property
    def tool_pose(self) -> Pose:
        """Pose of the tool centre point."""
        return self._tool

    @property
    def tool_velocity(self) -> Array:
        """Velocity zero `(3,)` [m/s]: a released object falls straight down."""
        return np.zeros(3)

    @property
    def destination(self) -> Array:
        """Position of the tool at the end of the running motion, or now if it is at rest `(3,)` [m]."""
        return (self._path[-1] if self._path else self._tool).position

    @property
    def at_rest(self) -> bool:
        """True while no motion runs."""
        return not self._path

    @property
    def collision(self) -> str | None:
        """Description of the obstacle that stopped the last motion, or None."""
        return self._met_obstacle

    def plan(self, goal: Goal | str, task: Task = Task()) -> Plan[FakeMotion]:
        """Begin to plan a motion to a goal or a named pose; a plan from `plan_ahead` is complete at once.

        The result raises Unreachable for a goal beyond `MAX_REACH` from the base, and Blocked if the tool tip
        or the load would enter the table or a bin; as for the simulated arm, also on the guarded part.
        """
        return self._plans.plan(self.destination, goal, task)

    def plan_ahead(self, goal: Goal | str, task: Task = Task()) -> None:
        """Plan the next motion, from the end of the running motion, before `plan` requests it."""
        self._plans.plan_ahead(self.destination, goal, task)

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
        self._half_length = len(self._path) // 2
        self._met_obstacle = None

    def set_tool_pose(self, pose: Pose) -> None:
        """Move the tool to a pose at once; the arm is then at rest."""
        self._tool, self._path = pose, []

    def stop(self) -> None:
        """End the running motion without braking."""
        if self._path:
            self.commands.append("stop")
        self._path = []

    def run_into(self, obstacle: str) -> None:
        """Stop the running motion and set `collision` to an obstacle; do nothing if the arm is at rest."""
        if self._path:
            self._met_obstacle = obstacle
            self.stop()

    def advance(self) -> None:
        """Move tool and held object one step along the path; stop before the object enters table or bins."""
        if self._path and (collision := self._find_load_collision(self._path[0])):
            self.run_into(f"{collision.part} ran into {collision.obstacle}, {collision.tool_position_text}")
        elif self._path:
            self._tool = self._path.pop(0)
            if self.next_obstacle is not None and len(self._path) <= self._half_length:
                self._met_obstacle, self.next_obstacle = self.next_obstacle, None
                self.stop()
        if self._world.held is not None:
            held = self._world.held
            height = self._world.classes[held.label].height
            held.position = self._tool.position - np.array([0.0, 0.0, height / 2])

    def _find_load_collision(self, pose: Pose) -> Collision | None:
        """Return the collision of the held object in a motion to `pose`, or None; plans may lack it."""
        held = self._world.held
        if held is None:
            return None
        tips = np.array([self._tool.position, pose.position])
        return self._obstacles.find_collision(tips, self._world.classes[held.label])

    def _plan_motion(self, start: Array, goal: Goal | str, task: Task) -> FakeMotion:
        load = task.load.kind if task.load else None
        collisions = []
        for path in self._generate_paths(start, goal):
            tips = np.array([start, *(pose.position for pose in path)])
            collision = self._obstacles.find_collision(tips, load)
            if collision is None:
                return FakeMotion(path)
            collisions.append(collision)
        part, obstacle, depth, tool_position_text = collisions[-1]
        raise Blocked(f"the motion would bring {part} {depth:.3f} m into {obstacle}, {tool_position_text}")

    def _generate_paths(self, start: Array, goal: Goal | str) -> Iterator[list[Pose]]:
        """Yield candidate paths, best first: straight if the goal is a named pose, then at travel height."""
        raised_position = np.array([*start[:2], max(start[2], self._height)])
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
        position_over_goal = np.array([*end_position[:2], max(guarded_start[2], self._height)])
        fast_part = [
            pose
            for a, b in pairwise([start, raised_position, position_over_goal, guarded_start])
            for pose in _make_straight_path(a, b, rotation, MAX_TOOL_SPEED)
        ]
        yield [*fast_part, *_make_straight_path(guarded_start, end_position, rotation, speed)]


class FakeTool:
    """A suction cup that seals on every object that it touches, unless `can_seal` returns False.

    Attributes:
        can_seal: Function that returns True if the cup can seal on the touched object; set by tests.
        breakaway_force: Force that every seal withstands [N].
    """

    def __init__(self, world: FakeWorld, tip: Callable[[], Array]) -> None:
        self._world = world
        self._tip = tip
        self.can_seal: Callable[[], bool] = lambda: True
        self.breakaway_force = DEFAULT_BREAKAWAY_FORCE

    @property
    def touching(self) -> bool:
        """True while the cup touches an object or the table."""
        return self._world.find_touched_object(self._tip()) is not None or float(self._tip()[2]) <= 0.0

    @property
    def holding(self) -> bool:
        """True while the tool holds an object."""
        return self._world.held is not None

    @property
    def holding_force(self) -> float:
        """Breakaway force of the seal [N]; 0 while the tool holds nothing."""
        return self.breakaway_force if self.holding else 0.0

    def close(self) -> None:
        """Seal the cup on the touched object."""
        self._world.is_commanded = True
        touched = self._world.find_touched_object(self._tip())
        if touched is not None and self.can_seal():
            self._world.held, touched.is_dropped = touched, False

    def open(self) -> None:
        """Release the held object; it falls straight down."""
        self._world.is_commanded = True
        self._release()

    def break_seal(self) -> None:
        """Break the seal: the held object falls straight down, and rolls off other objects and bin walls."""
        dropped = self._world.held
        self._release()
        if dropped is not None:
            dropped.is_dropped = True
            self._world.roll_to_free_position(dropped)
            dropped.rest_positions[-1] = dropped.position.copy()

    def _release(self) -> None:
        released, self._world.held = self._world.held, None
        if released is not None:
            released.position[2] = self._world.classes[released.label].height / 2
            released.rest_positions.append(released.position.copy())


def compute_named_poses(config: CellConfig) -> dict[str, Pose]:
    """Return the tool pose of each named pose of a cell file."""
    kinematics = build_kinematics(config)
    return {name: kinematics.compute_tool_pose(np.radians(q)) for name, q in config.arm.poses_deg.items()}


def check_reachable(position: Array) -> None:
    """Check that the fake tool reaches a position `(3,)` [m].

    Raises:
        Unreachable: The position is farther than `MAX_REACH` from the base.
    """
    distance = float(np.linalg.norm(position))
    if distance > MAX_REACH:
        raise Unreachable(f"{distance:.2f} m from the base is more than the arm's {MAX_REACH:.2f} m")


def find_places_out_of_reach(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield a key of the cell file and a message for each bin and safe place beyond `MAX_REACH`."""
    height = compute_travel_height(config)
    return find_unreachable_places(config, lambda place, _: check_reachable(np.array([*place, height])))


def _make_straight_path(start: Array, end: Array, rotation: Array, speed: float) -> list[Pose]:
    """Return the tool poses of a straight path from the position `start`, excluded, to `end`, `(3,)` [m]."""
    count = math.ceil(float(np.linalg.norm(end - start)) / speed / STEP)
    return [Pose(rotation, start + (end - start) * (i + 1) / count) for i in range(count)]
