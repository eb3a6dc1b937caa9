"""The fake cell's arm and tool: ideal, deterministic, and breakable by a test."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from executive.cell import Motion, Via
from executive.cell_config import CellConfig
from executive.errors import Fault, Unreachable
from executive.geometry import Array, Pose, tool_down
from executive.layout import as_bin, travel_height
from executive.messages import ObjectClass
from executive.motion.kinematics import Kinematics
from executive.testing.fake_world import STEP, FakeWorld
from executive.workcell import KeyPath

REACH = 0.85
"""Largest distance of the fake tool from the base [m]."""

SPEED = 1.0
"""Tool speed of the fake arm where a via does not say otherwise [m/s]."""


@dataclass(frozen=True, eq=False)
class FakeMotion:
    """Tool poses, one per control step."""

    path: Sequence[Pose]

    @property
    def duration(self) -> float:
        """Time it takes [s]."""
        return len(self.path) * STEP


class FakeArm:
    """An arm that is its tool: it goes in straight lines at constant speed and stops dead.

    Attributes:
        poses: Tool pose of each named pose; a run begins at `home`.
        commanded: Every call that moves it, in order, for a test to look at.
    """

    def __init__(self, world: FakeWorld, poses: Mapping[str, Pose]) -> None:
        self._world = world
        self.poses = dict(poses)
        self._tool = self.poses["home"]
        self._path: list[Pose] = []
        self.commanded: list[str] = []

    @property
    def q(self) -> Array:
        """The tool position, padded to seven numbers."""
        return np.concatenate([self._tool.position, np.zeros(4)])

    @property
    def tool_pose(self) -> Pose:
        """Pose of the tool centre point."""
        return self._tool

    @property
    def at_rest(self) -> bool:
        """True while no motion runs."""
        return not self._path

    def plan(self, vias: Sequence[Via], carrying: ObjectClass | None = None) -> FakeMotion:
        """Return straight lines through every via.

        Raises:
            Unreachable: A via is farther than `REACH` from the base.
        """
        del carrying
        path: list[Pose] = []
        here = self._tool.position
        for via in vias:
            require_reachable(via.position)
            path += _line(here, via.position, via.speed or SPEED)
            here = via.position
        return FakeMotion(path)

    def plan_to_pose(self, name: str) -> FakeMotion:
        """Return a straight line to the named pose."""
        end = self.poses[name]
        return FakeMotion([*_line(self._tool.position, end.position, SPEED)[:-1], end])

    def start(self, motion: Motion) -> None:
        """Begin to follow `motion`."""
        if not self.at_rest:
            raise Fault("the arm was started while it moves")
        assert isinstance(motion, FakeMotion), "the fake arm follows the motions it planned"
        self.commanded.append("start")
        self._path = list(motion.path)

    def stop(self) -> None:
        """Stand still at once."""
        if self._path:
            self.commanded.append("stop")
        self._path = []

    def advance(self) -> None:
        """Go one step along the path, with what the tool holds."""
        if self._path:
            self._tool = self._path.pop(0)
        if self._world.held is not None:
            thing = self._world.held
            height = self._world.classes[thing.label].height
            thing.position = self._tool.position - np.array([0.0, 0.0, height / 2])


class FakeTool:
    """A cup that seals whatever it is on, unless `seals` says no; what it lets go stands on the floor."""

    def __init__(self, world: FakeWorld, tip: Callable[[], Array]) -> None:
        self._world = world
        self._tip = tip
        self.seals: Callable[[], bool] = lambda: True

    @property
    def touching(self) -> bool:
        """True while the cup is on something, the table included."""
        return self._world.under(self._tip()) is not None or float(self._tip()[2]) <= 0.0

    @property
    def holding(self) -> bool:
        """True while something is sealed to the cup."""
        return self._world.held is not None

    def close(self) -> None:
        """Seal what the cup is on."""
        thing = self._world.under(self._tip())
        if thing is not None and self.seals():
            self._world.held = thing

    def open(self) -> None:
        """Let go; the object falls straight down."""
        thing, self._world.held = self._world.held, None
        if thing is not None:
            thing.position[2] = self._world.classes[thing.label].height / 2


def named_poses(config: CellConfig) -> dict[str, Pose]:
    """Return where each named pose of a cell file brings the tool."""
    kinematics = Kinematics(config.tool.length, np.radians(config.arm.limits.position_deg))
    return {name: kinematics.forward(np.radians(pose)) for name, pose in config.arm.poses_deg.items()}


def require_reachable(place: Array) -> None:
    """Return if the fake tool gets to a place `(3,)` [m].

    Raises:
        Unreachable: It is farther than `REACH` from the base.
    """
    distance = float(np.linalg.norm(place))
    if distance > REACH:
        raise Unreachable(f"{distance:.2f} m from the base is more than the arm's {REACH:.2f} m")


def out_of_reach(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield a key of the cell file and a sentence for every bin, and the safe place, beyond `REACH`."""
    high = travel_height(config)

    def sentence(*places: Array) -> str | None:
        try:
            for place in places:
                require_reachable(np.array([*place[:2], high]))
        except Unreachable as error:
            return str(error)
        return None

    for name, section in config.bins.items():
        if problem := sentence(*as_bin(name, section).slots):
            yield ("bins", name, "position"), f'the bin "{name}" is out of reach: {problem}'
    if problem := sentence(np.array(config.safe_place)):
        yield ("safe_place",), f"the safe place is out of reach: {problem}"


def _line(start: Array, end: Array, speed: float) -> list[Pose]:
    """Return the poses, tool down, of a straight way from `start` (left out) to `end` `(3,)` [m]."""
    rotation = tool_down(end).rotation
    count = max(1, int(np.ceil(float(np.linalg.norm(end - start)) / speed / STEP)))
    return [Pose(rotation, start + (end - start) * (i + 1) / count) for i in range(count)]
