"""A cell whose every answer goes through a tape: what the tree of a run sees."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from executive.arm import Arm, Goal, Motion, Planning, Task
from executive.cell import Camera, Cell, Detector, Localizer, Operator, Request, Steps, Tool
from executive.events import Emit
from executive.geometry import Array, Pose
from executive.messages import Answer, Box, Detection, Frame
from executive.tape.codec import (
    read_answer,
    read_array,
    read_frame,
    read_pose,
    write_answer,
    write_array,
    write_frame,
    write_pose,
)
from executive.tape.tape import Tape


def taped(cell: Cell, tape: Tape, emit: Emit) -> Cell:
    """Return the cell as its tape knows it; clock and ledger, bins and classes are none of its answers.

    Every action of the tool is told as an `intent` before it is done.
    """
    return replace(
        cell,
        clock=TapedClock(tape),
        arm=TapedArm(tape, cell.arm),
        tool=TapedTool(tape, cell.tool, emit),
        camera=TapedCamera(tape, cell.camera),
        detectors={name: TapedDetector(tape, name, one) for name, one in cell.detectors.items()},
        operator=TapedOperator(tape, cell.operator),
        localizer=TapedLocalizer(tape, cell.localizer),
    )


@dataclass(frozen=True)
class TapedClock:
    """The run's clock; implements `executive.cell.Clock`."""

    tape: Tape

    @property
    def now(self) -> float:
        """Time since the run began [s]."""
        return self.tape.clock()

    @property
    def step(self) -> float:
        """Length of one control step [s]."""
        return self.tape.step

    def sleep(self, duration: float) -> Steps:
        """Yield until `duration` [s] has passed on this clock."""
        end = self.now + duration
        while self.now < end - self.step / 2:
            yield


@dataclass(frozen=True)
class PlayedMotion:
    """All that is known of a motion that was planned in a recorded run; implements `executive.arm.Motion`."""

    duration: float


@dataclass(frozen=True)
class TapedArm:
    """The arm; implements `executive.arm.Arm`."""

    tape: Tape
    arm: Arm

    @property
    def q(self) -> Array:
        """Measured joint positions `(7,)` [rad]."""
        return self.tape.sense("arm.q", lambda: self.arm.q, write_array, read_array)

    @property
    def tool_pose(self) -> Pose:
        """Pose of the tool centre point in the world."""
        return self.tape.sense("arm.tool_pose", lambda: self.arm.tool_pose, write_pose, read_pose)

    @property
    def tool_velocity(self) -> Array:
        """Velocity of the tool centre point in the world `(3,)` [m/s]."""
        return self.tape.sense("arm.tool_velocity", lambda: self.arm.tool_velocity, write_array, read_array)

    @property
    def destination(self) -> Array:
        """Where the tool will be when the running motion is over, or is now `(3,)` [m]."""
        return self.tape.sense("arm.destination", lambda: self.arm.destination, write_array, read_array)

    @property
    def at_rest(self) -> bool:
        """True while no motion runs and no braking is under way."""
        return self.tape.sense("arm.at_rest", lambda: self.arm.at_rest)

    @property
    def met(self) -> str | None:
        """What the arm ran into in its last motion, or None."""
        return self.tape.sense("arm.met", lambda: self.arm.met)

    def plan(self, goal: Goal | str, task: Task = Task()) -> Planning:
        """Begin to plan a motion."""
        planning: list[Planning] = []
        self.tape.command(lambda: planning.append(self.arm.plan(goal, task)))
        return TapedPlanning(self.tape, planning[0] if planning else None)

    def plan_ahead(self, goal: Goal | str, task: Task = Task()) -> None:
        """Plan a motion before anybody asks for it."""
        self.tape.command(lambda: self.arm.plan_ahead(goal, task))

    def start(self, motion: Motion) -> None:
        """Begin to follow `motion`."""
        self.tape.command(lambda: self.arm.start(motion))

    def stop(self) -> None:
        """Brake along the running motion's path."""
        self.tape.command(lambda: self.arm.stop())


@dataclass(frozen=True)
class TapedPlanning:
    """A motion being planned, None where it only plays; implements `executive.arm.Planning`."""

    tape: Tape
    planning: Planning | None

    @property
    def ready(self) -> bool:
        """True from the tick at which the motion is known."""
        return self.tape.sense("plan.ready", lambda: self._planning.ready)

    def result(self) -> Motion:
        """Return the motion."""
        return self.tape.sense("plan", lambda: self._planning.result(), _duration, PlayedMotion)

    @property
    def _planning(self) -> Planning:
        assert self.planning is not None, "nothing asks the cell while a tape plays"
        return self.planning


@dataclass(frozen=True)
class TapedTool:
    """The tool; implements `executive.cell.Tool`."""

    tape: Tape
    tool: Tool
    emit: Emit

    @property
    def touching(self) -> bool:
        """True while the cup's lip is on something."""
        return self.tape.sense("tool.touching", lambda: self.tool.touching)

    @property
    def holding(self) -> bool:
        """True while the vacuum says that something is sealed to the cup."""
        return self.tape.sense("tool.holding", lambda: self.tool.holding)

    @property
    def bears(self) -> float:
        """The pull that the seal bears [N]."""
        return self.tape.sense("tool.bears", lambda: self.tool.bears)

    def close(self) -> None:
        """Switch the vacuum on."""
        self.emit("intent", action="close")
        self.tape.command(lambda: self.tool.close())

    def open(self) -> None:
        """Let go and switch the vacuum off."""
        self.emit("intent", action="open")
        self.tape.command(lambda: self.tool.open())


@dataclass(frozen=True)
class TapedCamera:
    """The camera; implements `executive.cell.Camera`."""

    tape: Tape
    camera: Camera

    @property
    def name(self) -> str:
        """Its name in the cell file."""
        return self.tape.sense("camera.name", lambda: self.camera.name)

    @property
    def scan_poses(self) -> Sequence[str]:
        """Names of the arm poses from which it sees the table, best first."""
        return self.tape.sense("camera.scan_poses", lambda: self.camera.scan_poses, list)

    def next_pose(self) -> str:
        """Return the scan pose after the one this returned last."""
        return self.tape.sense("camera.next_pose", lambda: self.camera.next_pose())

    def area(self, view: str) -> Box:
        """Return the part of the image [pixel] that `view` means."""
        return self.tape.sense(f"camera.area.{view}", lambda: self.camera.area(view), list, _box)

    def sees_table(self) -> bool:
        """Tell whether the whole workspace is in view now."""
        return self.tape.sense("camera.sees_table", lambda: self.camera.sees_table())

    def capture(self) -> Frame:
        """Return a fresh frame."""
        return self.tape.sense("camera.frame", lambda: self.camera.capture(), write_frame, read_frame)


@dataclass(frozen=True)
class TapedDetector:
    """A detector; implements `executive.cell.Detector`."""

    tape: Tape
    name: str
    detector: Detector

    def request(self, frame: Frame, view: str) -> Request:
        """Start to search `frame`."""
        request: list[Request] = []
        self.tape.command(lambda: request.append(self.detector.request(frame, view)))
        return TapedRequest(self.tape, f"detector.{self.name}", request[0] if request else None)


@dataclass(frozen=True)
class TapedRequest:
    """A detection under way, None where it only plays; implements `executive.cell.Request`."""

    tape: Tape
    name: str
    request: Request | None

    @property
    def ready(self) -> bool:
        """True from the tick at which the answer is due."""
        return self.tape.sense(f"{self.name}.ready", lambda: self._request.ready)

    def result(self) -> Answer:
        """Return what the detector says."""
        return self.tape.sense(self.name, lambda: self._request.result(), write_answer, read_answer)

    @property
    def _request(self) -> Request:
        assert self.request is not None, "nothing asks the cell while a tape plays"
        return self.request


@dataclass(frozen=True)
class TapedOperator:
    """The person beside the cell; implements `executive.cell.Operator`."""

    tape: Tape
    operator: Operator

    def ask(self, choices: Sequence[str]) -> str | None:
        """Return the next thing asked for."""
        return self.tape.sense("operator", lambda: self.operator.ask(choices))


@dataclass(frozen=True)
class TapedLocalizer:
    """How detections become positions; implements `executive.cell.Localizer`."""

    tape: Tape
    localizer: Localizer

    def locate(self, detection: Detection, frame: Frame) -> Array:
        """Return the centre of the detected object `(3,)` [m]."""
        ask: Callable[[], Array] = lambda: self.localizer.locate(detection, frame)  # noqa: E731
        return self.tape.sense("localizer", ask, write_array, read_array)


def _box(edges: Sequence[float]) -> Box:
    left, top, right, bottom = edges
    return left, top, right, bottom


def _duration(motion: Motion) -> float:
    return motion.duration
