"""Devices of a cell, which a driver implements: clock, arm, camera; and what only some drivers offer.

The tool of a driver implements `executive.cell.protocols.Tool`. A driver knows neither mission, planner,
ledger nor detector. Each entry point of the group `executive.drivers` is a `DriverKind`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from executive.cell.arm import Motion, MotionGuard, MovingArm
from executive.cell.config import CellConfig, ObjectConfig
from executive.cell.device_config import STEP
from executive.cell.frame import Detection
from executive.cell.protocols import Clock, Steps, Tool
from executive.errors import InputError
from executive.geometry import Array, Pose
from executive.plugins import list_entries
from executive.text.validate import KeyPath

DRIVER_GROUP = "executive.drivers"
"""Entry-point group of kinds of drivers."""
FORMER_DRIVER_GROUP = "executive.cells"
"""Former name of `DRIVER_GROUP`."""
DEFAULT_ROLE = "main"
"""Role of an arm or a tool that is the only one of its cell."""


class DeviceClock(Clock, Protocol):
    """Clock of the devices, which determines the ticks of a run: a `StepClock` or a `WallClock`."""

    @property
    def is_simulated(self) -> bool:
        """True if the time stands still between two ticks."""

    def begin(self, now: float) -> None:
        """Set the time [s], at the start of a run to 0, at its resumption to the time of the interruption."""

    def wait_for_tick(self) -> None:
        """Wait until the next tick; a simulation advances its devices to this tick."""


class StepClock:
    """Clock of a simulation, which stands still between two ticks; implements `DeviceClock`.

    Attributes:
        step: Time between two ticks [s].
        tick_count: Number of ticks since the start of the run.
        on_tick: Function that advances the devices to the time `now`, called at each tick.
    """

    is_simulated = True

    def __init__(self, step: float = STEP) -> None:
        self.step = step
        self.tick_count = 0
        self.on_tick: Callable[[], None] = lambda: None

    @property
    def now(self) -> float:
        """Time since the start of the run [s]."""
        return self.tick_count * self.step

    def sleep(self, duration: float) -> Steps:
        """Yield until the time has advanced by `duration` [s]."""
        return sleep_on(self, duration)

    def begin(self, now: float) -> None:
        """Set the time to a multiple of `step`."""
        self.tick_count = round(now / self.step)

    def wait_for_tick(self) -> None:
        """Advance the time by `step`, and the devices with it."""
        self.tick_count += 1
        self.on_tick()


class WallClock:
    """Clock of real devices; implements `DeviceClock`.

    Attributes:
        step: Time between two ticks [s].
        tick_count: Number of ticks since the start of the run.
        late_tick_count: Number of ticks that began at least one step too late.
        on_tick: Function that is called at each tick, for devices without a controller of their own.
    """

    is_simulated = False

    def __init__(self, step: float) -> None:
        self.step = step
        self.tick_count = 0
        self.late_tick_count = 0
        self.on_tick: Callable[[], None] = lambda: None
        self.begin(0.0)

    @property
    def now(self) -> float:
        """Time since the start of the run [s]."""
        return time.monotonic() - self._start

    def sleep(self, duration: float) -> Steps:
        """Yield until the time has advanced by `duration` [s]."""
        return sleep_on(self, duration)

    def begin(self, now: float) -> None:
        """Set the time; the next tick is one `step` later."""
        self._start = time.monotonic() - now
        self._next_tick = now + self.step

    def wait_for_tick(self) -> None:
        """Sleep until the next multiple of `step`; a late tick leaves out the multiples before it."""
        delay = self._next_tick - self.now
        if delay > 0:
            time.sleep(delay)
        elif -delay >= self.step:
            self.late_tick_count += 1
            self._next_tick += self.step * (-delay // self.step)
        self._next_tick += self.step
        self.tick_count += 1
        self.on_tick()


def sleep_on(clock: Clock, duration: float) -> Iterator[None]:
    """Yield until the time of a clock has advanced by `duration` [s]."""
    end = clock.now + duration
    while clock.now < end - clock.step / 2:
        yield


class ArmDevice(MovingArm, Protocol):
    """An arm with its controller, which follows trajectories at its own rate."""

    @property
    def q(self) -> Array:
        """Measured joint positions `(n,)` [rad]."""

    @property
    def qd(self) -> Array:
        """Measured joint velocities `(n,)` [rad/s]."""

    @property
    def end_q(self) -> Array:
        """Commanded joint positions `(n,)` [rad] at the end of the current motion; at rest, those of now."""

    def execute(self, motion: Motion, guard: MotionGuard) -> None:
        """Begin to follow `motion` from rest at its start; stop along its path as `guard` says.

        The arm also stops, and sets `collision`, if it touches something before `motion.guarded_start_time`,
        or if something pushes it off its path.

        Raises:
            Fault: The arm is moving, or is not at the start of the motion.
        """


class CameraImage(NamedTuple):
    """One image of a camera.

    Attributes:
        colour: Image `(H, W, 3)` uint8, RGB.
        depth: Depth image `(H, W)` [m] along the optical axis, NaN for pixels without a measurement; None
            for a camera without a depth sensor.
        stamp: Capture time on the clock of the driver [s].
        visible: Mask `(H, W)`, False for pixels that the arm occludes; None: the station computes the mask,
            but not for a kind without physics (`DriverKind`).
        true_detections: True detections, of a driver that knows them; None: unknown.
    """

    colour: NDArray[np.uint8]
    depth: Array | None
    stamp: float
    visible: NDArray[np.bool_] | None = None
    true_detections: tuple[Detection, ...] | None = None


class CameraDevice(Protocol):
    """A camera."""

    def capture(self) -> CameraImage:
        """Capture and return an image; hardware returns its latest image, at once."""


class Driver(Protocol):
    """The devices of one cell."""

    @property
    def clock(self) -> DeviceClock:
        """Clock of the devices, a `StepClock` or a `WallClock`."""

    @property
    def arms(self) -> Mapping[str, ArmDevice]:
        """Arms by role; of several arms, the role of the arm that moves is `DEFAULT_ROLE`."""

    @property
    def tools(self) -> Mapping[str, Tool]:
        """Tools by role, as the arms."""

    @property
    def cameras(self) -> Mapping[str, CameraDevice]:
        """Cameras by their names in the cell file."""

    def close(self) -> None:
        """Release all devices; the driver is unusable afterwards."""


@dataclass(frozen=True)
class DriverOptions:
    """What a driver gets beside the cell file.

    Attributes:
        seed: Random seed of the run.
        cell_folder: Folder of the cell file, to which paths in the file are relative.
        values: Options of the driver by name, from the command line; only the driver knows their meaning.
    """

    seed: int = 0
    cell_folder: Path = Path()
    values: Mapping[str, str] = field(default_factory=dict)


class DriverKind(Protocol):
    """Factory of drivers, and the checks of a cell file that only the driver can make.

    A kind may have a method `compute_mass(section)`, which returns the mass [kg] of the objects of a class,
    declared or not, or raises an `InputError`; `section` is an `executive.cell.config.ObjectConfig`. A kind
    may have a method `measure_hold(config, label)`, which returns the largest force [N] with which the tool
    can hold the model of a class. A kind with the attribute `is_rehearsal`, which is True, has no physics:
    its frames contain true detections, its arms hide nothing and move on straight joint paths, and nothing
    is measured. A kind may have an attribute `driver_options`, which contains `file` or `flag` by the name
    of each option that it knows; the run directory gets a copy of a file.
    """

    def __call__(self, config: CellConfig, options: DriverOptions) -> Driver:
        """Return a driver for a cell file (`executive.cell.config.CellConfig`).

        Raises:
            InputError: The driver does not support the cell file or an option.
        """

    def check(self, config: CellConfig, cell_folder: Path) -> Iterable[tuple[KeyPath, str]]:
        """Yield key and message of each error in the cell file that only the driver can find."""


def derive_seeds(seed: int) -> tuple[int, ...]:
    """Return the random seeds of objects, camera noise, detectors and load noise for the seed of a run."""
    return tuple(int(child.generate_state(1)[0]) for child in np.random.SeedSequence(seed).spawn(4))


def load_driver_kind(name: str) -> DriverKind:
    """Return the kind of drivers that the key `kind` of a cell file names.

    Raises:
        InputError: No package registers this kind, or its class cannot be loaded.
    """
    entries = list_entries(DRIVER_GROUP, "driver")
    if name in entries:
        kind: DriverKind = entries[name].load()
        if not (callable(kind) and hasattr(kind, "check")):
            raise InputError(f"the driver {entries[name].value} has no method `check`, or cannot be called")
        return kind
    if name in list_entries(FORMER_DRIVER_GROUP, "kind of cell"):
        raise InputError(
            f'a package registers "{name}" in the group {FORMER_DRIVER_GROUP}, which is not used; write a '
            f"driver (executive.cell.devices.Driver), and register it in {DRIVER_GROUP}"
        )
    installed = ", ".join(sorted(entries)) or "none"
    raise InputError(f'no installed package offers cells of kind "{name}"; installed: {installed}')


def find_driver_options(kind: str) -> Mapping[str, str]:
    """Return `file` or `flag` by the name of each option that a kind of driver knows.

    Raises:
        InputError: No package registers this kind, or its class cannot be loaded.
    """
    known_options: Mapping[str, str] = getattr(load_driver_kind(kind), "driver_options", {})
    return known_options


def check_driver_options(kind: str, options: Iterable[str]) -> None:
    """Raise an InputError if a kind of driver does not know an option."""
    for name in options:
        known_options = find_driver_options(kind)
        if name not in known_options:
            choices = ", ".join(known_options) or "none"
            advice = f"omit --{name}, or use a cell with another driver"
            raise InputError(
                f'the driver "{kind}" does not know the option "{name}"; it knows: {choices}; {advice}'
            )


def is_rehearsal(kind: DriverKind) -> bool:
    """Return True if a kind of drivers has no physics and no measured detectors."""
    return bool(getattr(kind, "is_rehearsal", False))


@runtime_checkable
class Rebuildable(Protocol):
    """Capability of a driver: its world can be rebuilt after the end of the process."""

    @property
    def last_command_tick(self) -> int:
        """Tick of the last start of a motion or command to the tool; 0 if none."""

    def log_to(self, path: Path) -> None:
        """Start a log file from which the world can be rebuilt at any tick; called before the first tick.

        Raises:
            InputError: The file cannot be written.
        """

    def rebuild(self, path: Path) -> int:
        """Rebuild the world at the end of a log, continue the log, let the arm brake; return the tick count.

        Raises:
            InputError: The log cannot be read, or is damaged.
        """


@runtime_checkable
class RayCaster(Protocol):
    """Capability of a driver: ray tests in its world."""

    def cast_ray(self, origin: Array, direction: Array) -> Array | None:
        """Return the first point `(3,)` [m] of a ray on a body other than arm and tool, or None."""


@dataclass(frozen=True)
class Shape:
    """A solid shape that is rigidly attached to a body.

    Attributes:
        body: Name of the body; "" for a shape that never moves.
        kind: Kind of shape: `box`, `cylinder`, `sphere` or `mesh`.
        size: Size along x, y and z [m]; for a mesh, scale factors along x, y and z.
        X_BS: Pose of the shape in the frame of the body.
        colour: Red, green and blue of the surface, 0 to 1.
        file: Path of the file of a mesh, with the suffix of its format; "" for other kinds.
    """

    body: str
    kind: str
    size: tuple[float, float, float]
    X_BS: Pose
    colour: tuple[float, float, float]
    file: str = ""


class Visuals(Protocol):
    """Shapes of a cell and their poses, for displays."""

    @property
    def shapes(self) -> Sequence[Shape]:
        """All shapes of the cell."""

    def poses(self) -> Mapping[str, Pose]:
        """Return the current pose `X_WB` of each body by name, without removed bodies."""


@runtime_checkable
class Visible(Protocol):
    """Capability of a driver: shapes for displays."""

    def visuals(self) -> Visuals:
        """Return the shapes and poses of the bodies."""


@dataclass(eq=False)
class TrueObject:
    """Ground truth about an object of a simulated, fake or rendered scene.

    Attributes:
        label: Class of the object, or `UNKNOWN_LABEL`.
        X_WO: Pose of the object in the world; its position is the centre of the object.
        body: Number of the object in its world.
        rest_positions: Positions of the object `(3,)` [m] at the start, and after each move and each fall.
        is_dropped: True if the object fell from the tool and has not been picked up since.
        bin: At the end of a run, name of the bin that contains the object; "" outside of all bins, None below
            the table.
        is_held: At the end of a run, True if the tool holds the object.
        is_removed: True if the object was removed from the world; `bin` is then the bin before the removal.
        model: Model of the object, already scaled, in a scene that is rendered.
        colour: Red, green and blue of the object, each 0 to 1; black if unknown.
    """

    label: str
    X_WO: Pose
    body: int = 0
    rest_positions: list[Array] = field(default_factory=list)
    is_dropped: bool = False
    bin: str | None = ""
    is_held: bool = False
    is_removed: bool = False
    model: ObjectConfig | None = None
    colour: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def position(self) -> Array:
        """Centre of the object `(3,)` [m]."""
        return self.X_WO.position


@runtime_checkable
class TrueWorld(Protocol):
    """Capability of a driver: its world is known and can be changed, by audits, tests and injected faults.

    Attributes:
        forgotten_count: Number of objects that were removed uncounted.
    """

    forgotten_count: int

    def list_objects(self) -> Sequence[TrueObject]:
        """Return all loose objects, in the order of their creation, without removed objects."""

    def list_final_objects(self) -> Iterable[TrueObject]:
        """Return all objects at the end of a run, including removed objects."""

    def find_held_object(self) -> TrueObject | None:
        """Return the object in the tool, or None."""

    def remove_object(self, true_object: TrueObject, *, is_counted: bool = True) -> None:
        """Remove an object that is not held from the world.

        If `is_counted` is False, `list_final_objects` does not return the object.
        """

    def move_object(self, true_object: TrueObject, displacement: tuple[float, float]) -> None:
        """Displace an object that is not held by `(x, y)` [m]."""

    def drop_held_object(self) -> None:
        """Let the tool lose the object that it holds."""

    def collide(self, message: str) -> None:
        """Let the moving arm collide: it stops, and `message` describes the collision."""
