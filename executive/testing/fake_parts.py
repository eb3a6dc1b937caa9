"""The fake cell's arm, tool, camera and detector: ideal, deterministic, and breakable by a test."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from executive.cell import Motion, Request, Steps, Via
from executive.errors import Fault, Unavailable, Unreachable
from executive.geometry import Array, Pose, looking_down, tool_down
from executive.messages import Box, Detection, Frame, ObjectClass
from executive.testing.fake_world import STEP, FakeWorld

REACH = 0.85
"""Largest distance of the fake tool from the base [m]."""

SPEED = 1.0
"""Tool speed of the fake arm where a via does not say otherwise [m/s]."""


class FakeClock:
    """A clock that only the test moves."""

    def __init__(self, world: FakeWorld) -> None:
        self._world = world

    @property
    def now(self) -> float:
        """Time since the run began [s]."""
        return self._world.now

    @property
    def step(self) -> float:
        """Length of one control step [s]."""
        return STEP

    def sleep(self, duration: float) -> Steps:
        """Yield until `duration` [s] has passed."""
        end = self.now + duration
        while self.now < end - STEP / 2:
            yield


@dataclass(frozen=True, eq=False)
class FakeMotion:
    """Tool positions, one per control step."""

    path: Array

    @property
    def duration(self) -> float:
        """Time it takes [s]."""
        return len(self.path) * STEP


class FakeArm:
    """An arm that is its tool: it goes in straight lines at constant speed and stops dead.

    Attributes:
        commanded: Every call that moves it, in order, for a test to look at.
    """

    def __init__(self, world: FakeWorld, poses: dict[str, Array]) -> None:
        self._world = world
        self._poses = poses
        self._tip = poses["home"]
        self._path: list[Array] = []
        self.commanded: list[str] = []

    @property
    def q(self) -> Array:
        """The tool position, padded to seven numbers."""
        return np.concatenate([self._tip, np.zeros(4)])

    @property
    def tool_pose(self) -> Pose:
        """Pose of the tool centre point."""
        return tool_down(self._tip)

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
        path: list[Array] = []
        here = self._tip
        for via in vias:
            distance = float(np.linalg.norm(via.position))
            if distance > REACH:
                raise Unreachable(f"{distance:.2f} m from the base is more than the arm's {REACH:.2f} m")
            length = float(np.linalg.norm(via.position - here))
            count = max(1, int(np.ceil(length / (via.speed or SPEED) / STEP)))
            path.extend(here + (via.position - here) * (i + 1) / count for i in range(count))
            here = via.position
        return FakeMotion(np.array(path).reshape(-1, 3))

    def plan_to_pose(self, name: str) -> FakeMotion:
        """Return a straight line to the named pose."""
        return self.plan([Via(self._poses[name])])

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
            self._tip = self._path.pop(0)
        if self._world.held is not None:
            thing = self._world.held
            height = self._world.classes[thing.label].height
            thing.position = self._tip - np.array([0.0, 0.0, height / 2])


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


class FakeCamera:
    """A camera 1.2 m above the table whose images are blank: its detector knows what they would show."""

    def __init__(self, world: FakeWorld, epoch: Callable[[], int]) -> None:
        self._world = world
        self._epoch = epoch
        self._count = 0
        self.sees: Callable[[], bool] = lambda: True

    @property
    def name(self) -> str:
        """Its name."""
        return "fake"

    @property
    def scan_poses(self) -> Sequence[str]:
        """Names of the arm poses from which it sees the table."""
        return ("home",)

    def next_pose(self) -> str:
        """Return the only one."""
        return "home"

    def area(self, view: str) -> Box:
        """Return the part of the image [pixel] that `view` means."""
        return (192.0, 100.0, 448.0, 356.0) if view == "table" else (0.0, 0.0, 640.0, 480.0)

    def sees_table(self) -> bool:
        """Tell what the test said."""
        return self.sees()

    def capture(self) -> Frame:
        """Return a blank frame with a true pose."""
        self._count += 1
        focal = 240 / np.tan(np.radians(27.5))
        return Frame(
            id=self._count,
            camera=self.name,
            image=np.zeros((480, 640, 3), dtype=np.uint8),
            depth=None,
            matrix=np.array([[focal, 0, 320.0], [0, focal, 240.0], [0, 0, 1.0]]),
            X_WC=looking_down((0.5, 0.0, 1.2)),
            stamp=self._world.now,
            visible=np.ones((480, 640), dtype=bool),
            epoch=self._epoch(),
        )


@dataclass(frozen=True)
class FakeRequest:
    """An answer that is due at a time."""

    due: float
    clock: FakeClock
    answer: Sequence[Detection] | str

    @property
    def ready(self) -> bool:
        """True once the time has come."""
        return self.clock.now >= self.due

    def result(self) -> Sequence[Detection]:
        """Return the detections, or raise Unavailable with the sentence scripted."""
        if isinstance(self.answer, str):
            raise Unavailable(self.answer)
        return self.answer


class FakeDetector:
    """A detector that sees every object, unless `answers` says otherwise for a look.

    `answers` gets the number of the look (from 1) and the true detections, and returns detections, or a
    sentence to be unavailable with.
    """

    def __init__(self, world: FakeWorld, clock: FakeClock, latency: float = 0.05) -> None:
        self._world = world
        self._clock = clock
        self._latency = latency
        self._looks = 0
        self.answers: Callable[[int, Sequence[Detection]], Sequence[Detection] | str] = _truthful

    @property
    def threshold(self) -> float:
        """Confidence from which a detection counts."""
        return 0.5

    def request(self, frame: Frame, view: str) -> Request:
        """Answer `latency` later with what the frame would show."""
        del view
        self._looks += 1
        true = [self._detection(frame, thing.label, thing.position) for thing in self._world.objects]
        return FakeRequest(frame.stamp + self._latency, self._clock, self.answers(self._looks, true))

    def close(self) -> None:
        """Have nothing to give back."""

    def _detection(self, frame: Frame, label: str, position: Array) -> Detection:
        x, y, z = frame.matrix @ frame.X_WC.inverse().apply(position)
        size = frame.matrix[0, 0] * self._world.classes[label].radius / z
        return Detection(label, 0.9, (x / z - size, y / z - size, x / z + size, y / z + size))


def _truthful(look: int, true: Sequence[Detection]) -> Sequence[Detection]:
    del look
    return true
