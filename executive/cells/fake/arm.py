"""The fake cell's arm and tool: ideal, deterministic, and breakable by a test."""

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
"""Largest distance of the fake tool from the base [m]."""

TOOL_SPEED = 1.0
"""Tool speed of the fake arm where a goal does not say otherwise [m/s]."""

SEAL_STRENGTH = 7.9
"""The pull that a fake seal bears, unless a test says otherwise [N]."""


@dataclass(frozen=True, eq=False)
class FakeMotion:
    """Tool poses, one per control step."""

    path: Sequence[Pose]

    @property
    def duration(self) -> float:
        """Time it takes [s]."""
        return len(self.path) * STEP


class FakeArm:
    """An arm that is its tool: straight up, across and down at constant speed; it stops dead.

    It heeds the limits of its reach, and of the task the load: neither the tool tip nor the lower end of the
    load enters the table or the bins. Objects are not in its way.

    Args:
        world: Where it moves what it holds.
        config: The cell file: named poses, travel height, bins and the time that planning takes.
        clock: The run's.
        emit: Tells the run what happens.

    Attributes:
        poses: Tool pose of each named pose; a run begins at `home`.
        runs_into: What the arm runs into half way through its next motion, or None; for a test to say.
        commanded: Every call that moves it, in order, for a test to look at.
    """

    def __init__(self, world: FakeWorld, config: CellConfig, clock: Clock, emit: Emit = ignore) -> None:
        self.poses = named_poses(config)
        self.runs_into: str | None = None
        self.commanded: list[str] = []
        self._world = world
        self._height = travel_height(config)
        self._joint_count = config.arm.joint_count
        self._obstacles = FakeObstacles(config)
        self._plans = Plans(self._solve, clock, config.motion.planning, emit)
        self._tool = self.poses["home"]
        self._path: list[Pose] = []
        self._half = 0
        self._met: str | None = None

    @property
    def q(self) -> Array:
        """The tool position, padded with zeros to the number of joints."""
        return np.concatenate([self._tool.position, np.zeros(self._joint_count - 3)])

    @property
    def tool_pose(self) -> Pose:
        """Pose of the tool centre point."""
        return self._tool

    @property
    def tool_velocity(self) -> Array:
        """Zero `(3,)` [m/s]: it stops dead, and what it lets go falls straight down."""
        return np.zeros(3)

    @property
    def destination(self) -> Array:
        """Where the tool will be when the running motion is over, or is now `(3,)` [m]."""
        return (self._path[-1] if self._path else self._tool).position

    @property
    def at_rest(self) -> bool:
        """True while no motion runs."""
        return not self._path

    @property
    def met(self) -> str | None:
        """What the arm ran into in its last motion, or None."""
        return self._met

    def plan(self, goal: Goal | str, task: Task = Task()) -> Plan[FakeMotion]:
        """Begin to plan a motion to a goal or a named pose; what was planned ahead is known at once.

        The result raises Unreachable beyond `MAX_REACH` from the base, and Blocked where the
        tool tip, or the load of the task, would enter the table or a bin, as the simulated arm's does: also
        on the guarded part.
        """
        return self._plans.now(self.destination, goal, task)

    def plan_ahead(self, goal: Goal | str, task: Task = Task()) -> None:
        """Plan a motion, from where the running one will end, before anybody asks for it."""
        self._plans.ahead(self.destination, goal, task)

    def start(self, motion: Motion) -> None:
        """Begin to follow `motion`.

        Raises:
            Fault: The arm is moving, or `motion` was not planned by this arm.
        """
        if not self.at_rest:
            raise Fault("the arm was started while it moves")
        refuse_steps(motion)
        if not isinstance(motion, FakeMotion):
            raise Fault(f"the fake arm follows its own planned motions, not a {type(motion).__name__}")
        self.commanded.append("start")
        self._world.is_commanded = True
        self._path = list(motion.path)
        self._half = len(self._path) // 2
        self._met = None

    def put(self, pose: Pose) -> None:
        """Let the tool be at `pose`, at rest."""
        self._tool, self._path = pose, []

    def stop(self) -> None:
        """Stand still at once."""
        if self._path:
            self.commanded.append("stop")
        self._path = []

    def run_into(self, what: str) -> None:
        """Stop as after running into `what`, which `met` then tells; nothing where no motion runs."""
        if self._path:
            self._met = what
            self.stop()

    def advance(self) -> None:
        """Go one step along the path, with what the tool holds, which stops the arm at table and bins."""
        if self._path and (collision := self._find_collision_of_held(self._path[0])):
            self.run_into(f"{collision.part} ran into {collision.obstacle}, {collision.place}")
        elif self._path:
            self._tool = self._path.pop(0)
            if self.runs_into is not None and len(self._path) <= self._half:
                self._met, self.runs_into = self.runs_into, None
                self.stop()
        if self._world.held is not None:
            thing = self._world.held
            height = self._world.classes[thing.label].height
            thing.position = self._tool.position - np.array([0.0, 0.0, height / 2])

    def _find_collision_of_held(self, pose: Pose) -> Collision | None:
        """Return what stops the held object on the way to a pose: the plan may not have known of it."""
        held = self._world.held
        if held is None:
            return None
        tips = np.array([self._tool.position, pose.position])
        return self._obstacles.find_collision(tips, self._world.classes[held.label])

    def _solve(self, start: Array, goal: Goal | str, task: Task) -> FakeMotion:
        load = task.load.kind if task.load else None
        collisions = []
        for path in self._paths(start, goal):
            tips = np.array([start, *(pose.position for pose in path)])
            collision = self._obstacles.find_collision(tips, load)
            if collision is None:
                return FakeMotion(path)
            collisions.append(collision)
        part, obstacle, depth, place = collisions[-1]
        raise Blocked(f"the motion would bring {part} {depth:.3f} m into {obstacle}, {place}")

    def _paths(self, start: Array, goal: Goal | str) -> Iterator[list[Pose]]:
        """Yield the paths to a goal, best first: to a named pose straight, and then as to any other."""
        raised = np.array([*start[:2], max(start[2], self._height)])
        if isinstance(goal, str):
            end = self.poses[goal]
            place = above = end.position
            rotation, speed = end.rotation, TOOL_SPEED
            yield [*_line(start, place, rotation, TOOL_SPEED)[:-1], end]
        else:
            place = np.array(goal.position)
            check_reachable(place)
            above = np.array([*place[:2], place[2] + goal.guarded])
            rotation, speed = tool_down(place, goal.yaw or 0.0).rotation, min(goal.speed, TOOL_SPEED)
        over = np.array([*place[:2], max(above[2], self._height)])
        fast = [
            pose
            for a, b in pairwise([start, raised, over, above])
            for pose in _line(a, b, rotation, TOOL_SPEED)
        ]
        yield [*fast, *_line(above, place, rotation, speed)]


class FakeTool:
    """A cup that seals whatever it is on, unless `seals` says no; what it lets go stands on the floor.

    Attributes:
        seals: Tells whether the cup seals what it is on.
        strength: The pull that its seals bear [N].
    """

    def __init__(self, world: FakeWorld, tip: Callable[[], Array]) -> None:
        self._world = world
        self._tip = tip
        self.seals: Callable[[], bool] = lambda: True
        self.strength = SEAL_STRENGTH

    @property
    def touching(self) -> bool:
        """True while the cup is on something, the table included."""
        return self._world.under(self._tip()) is not None or float(self._tip()[2]) <= 0.0

    @property
    def holding(self) -> bool:
        """True while something is sealed to the cup."""
        return self._world.held is not None

    @property
    def bears(self) -> float:
        """The pull that the seal bears [N]; 0 while nothing is held."""
        return self.strength if self.holding else 0.0

    def close(self) -> None:
        """Seal what the cup is on."""
        self._world.is_commanded = True
        thing = self._world.under(self._tip())
        if thing is not None and self.seals():
            self._world.held, thing.fell = thing, False

    def open(self) -> None:
        """Let go; the object falls straight down."""
        self._world.is_commanded = True
        self._let_go()

    def part(self) -> None:
        """Let the seal give way; what hung there falls straight down, and off what it falls on."""
        thing = self._world.held
        self._let_go()
        if thing is not None:
            thing.fell = True
            self._world.roll_off(thing)
            thing.stood[-1] = thing.position.copy()

    def _let_go(self) -> None:
        thing, self._world.held = self._world.held, None
        if thing is not None:
            thing.position[2] = self._world.classes[thing.label].height / 2
            thing.stood.append(thing.position.copy())


def named_poses(config: CellConfig) -> dict[str, Pose]:
    """Return where each named pose of a cell file brings the tool."""
    kinematics = build_kinematics(config)
    return {name: kinematics.forward(np.radians(pose)) for name, pose in config.arm.poses_deg.items()}


def check_reachable(place: Array) -> None:
    """Return if the fake tool gets to a place `(3,)` [m].

    Raises:
        Unreachable: It is farther than `MAX_REACH` from the base.
    """
    distance = float(np.linalg.norm(place))
    if distance > MAX_REACH:
        raise Unreachable(f"{distance:.2f} m from the base is more than the arm's {MAX_REACH:.2f} m")


def find_places_out_of_reach(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield a key of the cell file and a sentence for every bin, and the safe place, beyond `MAX_REACH`."""
    high = travel_height(config)
    return places_out_of_reach(config, lambda place, _: check_reachable(np.array([*place, high])))


def _line(start: Array, end: Array, rotation: Array, speed: float) -> list[Pose]:
    """Return the poses of a straight way from `start` (left out) to `end` `(3,)` [m]."""
    count = math.ceil(float(np.linalg.norm(end - start)) / speed / STEP)
    return [Pose(rotation, start + (end - start) * (i + 1) / count) for i in range(count)]
