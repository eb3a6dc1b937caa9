"""Ideal arm and tool of the fake cell; tests can make them fail."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from executive.cell.arm import Goal, Motion, Task, refuse_steps
from executive.cell.clock import STEP
from executive.cell.config import CellConfig
from executive.cell.layout import places_out_of_reach, travel_height
from executive.cell.protocols import Clock
from executive.cell.workcell import KeyPath
from executive.cells.fake.obstacles import Collision, FakeObstacles
from executive.cells.fake.world import FakeWorld
from executive.errors import Blocked, Fault, Unreachable
from executive.events import Emit, ignore
from executive.geometry import Array, Pose, tool_down
from executive.motion.arms import build_kinematics
from executive.motion.plans import Plan, Plans

MAX_REACH = 0.85
"""Maximum distance of the fake tool from the base [m]."""

TOOL_SPEED = 1.0
"""Maximum tool speed of the fake arm, and default speed of a goal [m/s]."""

SEAL_STRENGTH = 7.9
"""Default breakaway force of the seal of the fake tool [N]."""


@dataclass(frozen=True, eq=False)
class FakeMotion:
    """A motion of the fake arm: one tool pose for each control step."""

    path: Sequence[Pose]

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return len(self.path) * STEP


class FakeArm:
    """An arm without links: the tool moves straight up, across and down at constant speed.

    The arm stops at once. Its reach is limited, and neither the tool tip nor the lower end of the load may
    enter the table or the bins. Objects are no obstacles.

    Args:
        world: The world that contains the held object.
        config: The cell file: named poses, travel height, bins and planning time.
        clock: Clock of the run.
        emit: Receives the events of the arm.

    Attributes:
        poses: Tool pose of each named pose; a run begins at `home`.
        next_obstacle: Obstacle that stops the arm half way through its next motion, or None; set by tests.
        commands: Names of the commands `start` and `stop` in order, for tests.
    """

    def __init__(self, world: FakeWorld, config: CellConfig, clock: Clock, emit: Emit = ignore) -> None:
        self.poses = named_poses(config)
        self.next_obstacle: str | None = None
        self.commands: list[str] = []
        self._world = world
        self._height = travel_height(config)
        self._joint_count = config.arm.joint_count
        self._obstacles = FakeObstacles(config)
        self._plans = Plans(self._solve, clock, config.motion.planning, emit)
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
    def met(self) -> str | None:
        """Obstacle that stopped the last motion, in words, or None."""
        return self._met_obstacle

    def plan(self, goal: Goal | str, task: Task = Task()) -> Plan[FakeMotion]:
        """Begin to plan a motion to a goal or a named pose; a plan made ahead is complete at once.

        The result raises Unreachable for a goal beyond `MAX_REACH` from the base, and Blocked if the tool tip
        or the load would enter the table or a bin, even on the guarded part, as with the simulated arm.
        """
        return self._plans.plan(self.destination, goal, task)

    def plan_ahead(self, goal: Goal | str, task: Task = Task()) -> None:
        """Plan a motion from the end of the running motion, before `plan` is called for it."""
        self._plans.plan_ahead(self.destination, goal, task)

    def start(self, motion: Motion) -> None:
        """Begin to follow a motion.

        Raises:
            Fault: The arm is moving, or another arm planned the motion.
        """
        if not self.at_rest:
            raise Fault("the arm was started while it moves")
        refuse_steps(motion)
        if not isinstance(motion, FakeMotion):
            raise Fault(f"the fake arm follows its own planned motions, not a {type(motion).__name__}")
        self.commands.append("start")
        self._world.is_commanded = True
        self._path = list(motion.path)
        self._half_length = len(self._path) // 2
        self._met_obstacle = None

    def put(self, pose: Pose) -> None:
        """Place the tool at a pose, at rest."""
        self._tool, self._path = pose, []

    def stop(self) -> None:
        """Stop the arm at once."""
        if self._path:
            self.commands.append("stop")
        self._path = []

    def run_into(self, obstacle: str) -> None:
        """Stop the running motion and set `met` to an obstacle; do nothing if the arm is at rest."""
        if self._path:
            self._met_obstacle = obstacle
            self.stop()

    def advance(self) -> None:
        """Move tool and held object one step along the path; stop if the object meets table or bins."""
        if self._path and (collision := self._find_collision_of_held(self._path[0])):
            self.run_into(f"{collision.part} ran into {collision.obstacle}, {collision.place}")
        elif self._path:
            self._tool = self._path.pop(0)
            if self.next_obstacle is not None and len(self._path) <= self._half_length:
                self._met_obstacle, self.next_obstacle = self.next_obstacle, None
                self.stop()
        if self._world.held is not None:
            held = self._world.held
            height = self._world.classes[held.label].height
            held.position = self._tool.position - np.array([0.0, 0.0, height / 2])

    def _find_collision_of_held(self, pose: Pose) -> Collision | None:
        """Return the collision of the held object on the way to a pose, also if the plan lacks the object."""
        held = self._world.held
        if held is None:
            return None
        tips = np.array([self._tool.position, pose.position])
        return self._obstacles.find_collision(tips, self._world.classes[held.label])

    def _solve(self, start: Array, goal: Goal | str, task: Task) -> FakeMotion:
        load = task.load.kind if task.load else None
        collisions = []
        for path in self._generate_paths(start, goal):
            tips = np.array([start, *(pose.position for pose in path)])
            collision = self._obstacles.find_collision(tips, load)
            if collision is None:
                return FakeMotion(path)
            collisions.append(collision)
        part, obstacle, depth, place = collisions[-1]
        raise Blocked(f"the motion would bring {part} {depth:.3f} m into {obstacle}, {place}")

    def _generate_paths(self, start: Array, goal: Goal | str) -> Iterator[list[Pose]]:
        """Yield paths to a goal, best first: straight to a named pose, then at travel height."""
        raised = np.array([*start[:2], max(start[2], self._height)])
        if isinstance(goal, str):
            end = self.poses[goal]
            place = above = end.position
            rotation, speed = end.rotation, TOOL_SPEED
            yield [*_straight_path(start, place, rotation, TOOL_SPEED)[:-1], end]
        else:
            place = np.array(goal.position)
            check_reachable(place)
            above = np.array([*place[:2], place[2] + goal.guarded])
            rotation, speed = tool_down(place, goal.yaw or 0.0).rotation, min(goal.speed, TOOL_SPEED)
        over = np.array([*place[:2], max(above[2], self._height)])
        fast_part = [
            pose
            for a, b in pairwise([start, raised, over, above])
            for pose in _straight_path(a, b, rotation, TOOL_SPEED)
        ]
        yield [*fast_part, *_straight_path(above, place, rotation, speed)]


class FakeTool:
    """A suction cup that seals on every object that it touches, unless a test sets `is_sealing`.

    Attributes:
        is_sealing: Returns True if the cup can seal on the touched object; set by tests.
        strength: Breakaway force of the seals [N].
    """

    def __init__(self, world: FakeWorld, tip: Callable[[], Array]) -> None:
        self._world = world
        self._tip = tip
        self.is_sealing: Callable[[], bool] = lambda: True
        self.strength = SEAL_STRENGTH

    @property
    def touching(self) -> bool:
        """True while the cup touches an object or the table."""
        return self._world.find_touched_object(self._tip()) is not None or float(self._tip()[2]) <= 0.0

    @property
    def holding(self) -> bool:
        """True while the tool holds an object."""
        return self._world.held is not None

    @property
    def bears(self) -> float:
        """Breakaway force of the seal [N]; 0 while the tool holds nothing."""
        return self.strength if self.holding else 0.0

    def close(self) -> None:
        """Seal the cup on the touched object."""
        self._world.is_commanded = True
        touched = self._world.find_touched_object(self._tip())
        if touched is not None and self.is_sealing():
            self._world.held, touched.fell = touched, False

    def open(self) -> None:
        """Release the held object; it falls straight down."""
        self._world.is_commanded = True
        self._release()

    def part(self) -> None:
        """Let the seal fail: the held object falls straight down, and rolls off whatever it falls on."""
        dropped = self._world.held
        self._release()
        if dropped is not None:
            dropped.fell = True
            self._world.roll_off(dropped)
            dropped.stood[-1] = dropped.position.copy()

    def _release(self) -> None:
        released, self._world.held = self._world.held, None
        if released is not None:
            released.position[2] = self._world.classes[released.label].height / 2
            released.stood.append(released.position.copy())


def named_poses(config: CellConfig) -> dict[str, Pose]:
    """Return the tool pose of each named pose of a cell file."""
    kinematics = build_kinematics(config)
    return {name: kinematics.forward(np.radians(pose)) for name, pose in config.arm.poses_deg.items()}


def check_reachable(place: Array) -> None:
    """Check that the fake tool reaches a position `(3,)` [m].

    Raises:
        Unreachable: The position is farther than `MAX_REACH` from the base.
    """
    distance = float(np.linalg.norm(place))
    if distance > MAX_REACH:
        raise Unreachable(f"{distance:.2f} m from the base is more than the arm's {MAX_REACH:.2f} m")


def find_places_out_of_reach(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield a key of the cell file and a message for each bin and safe place beyond `MAX_REACH`."""
    height = travel_height(config)
    return places_out_of_reach(config, lambda place, _: check_reachable(np.array([*place, height])))


def _straight_path(start: Array, end: Array, rotation: Array, speed: float) -> list[Pose]:
    """Return the poses of a straight path from `start` (excluded) to `end`, positions `(3,)` [m]."""
    count = math.ceil(float(np.linalg.norm(end - start)) / speed / STEP)
    return [Pose(rotation, start + (end - start) * (i + 1) / count) for i in range(count)]
