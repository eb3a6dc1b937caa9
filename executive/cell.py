"""The protocols a skill sees: what a work cell offers, whatever it is made of.

A skill gets one `Cell` and talks to its parts only through these protocols, so it runs unchanged in
simulation, on the fake cell of the test kit, and on hardware that implements them. Nothing here
blocks: a skill asks, yields, and looks again at the next tick.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from executive.events import Emit
from executive.geometry import Array, Pose

Box = tuple[float, float, float, float]
"""Left, top, right, bottom [pixel] in a frame's image; pixel i covers [i, i + 1)."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One camera image with everything needed to use it later, wherever the camera is then.

    Attributes:
        id: Number of the frame in this run, unique over all cameras.
        camera: Name of the camera.
        image: `(H, W, 3)` uint8, RGB.
        depth: `(H, W)` [m] along the optical axis, or None for a camera without depth.
        matrix: Camera matrix `(3, 3)` [pixel].
        X_WC: Camera pose in the world at capture, OpenCV convention (z forward, y down).
        stamp: Capture time on the run's clock [s].
        visible: `(H, W)` bool, False where the arm hides the scene, from its kinematics.
        epoch: Change count of the table at capture (see `Ledger.epoch`).
    """

    id: int
    camera: str
    image: NDArray[np.uint8]
    depth: Array | None
    matrix: Array
    X_WC: Pose
    stamp: float
    visible: NDArray[np.bool_]
    epoch: int


@dataclass(frozen=True)
class Detection:
    """One object a detector believes to see.

    Attributes:
        label: Class name.
        confidence: 0 to 1.
        box: Bounding box of the whole object [pixel] in the frame's image.
    """

    label: str
    confidence: float
    box: Box

    @property
    def centre(self) -> tuple[float, float]:
        """Centre of the box [pixel]."""
        left, top, right, bottom = self.box
        return (left + right) / 2, (top + bottom) / 2


@dataclass(frozen=True, eq=False)
class Detections:
    """A detector's answer about one frame; an empty one is an answer too.

    Attributes:
        frame: The image looked at.
        found: Detections at or above the threshold, most confident first.
        view: Name of the part of the frame that was searched: `table` or `full`.
        area: That part [pixel].
    """

    frame: Frame
    found: tuple[Detection, ...]
    view: str
    area: Box

    def searched(self, position: Array) -> bool:
        """Tell whether a point `(3,)` [m] of the world lay in the searched part, the arm not before it."""
        x, y, z = self.frame.matrix @ self.frame.X_WC.inverse().apply(position)
        if z <= 0:
            return False
        column, row = x / z, y / z
        left, top, right, bottom = self.area
        if not (left <= column < right and top <= row < bottom):
            return False
        return bool(self.frame.visible[int(row), int(column)])


Item = str
"""Identity of one physical object in the ledger, for instance `cube-2`."""


@dataclass(frozen=True, eq=False)
class Target:
    """A detection localized in the world and bound to an item.

    Attributes:
        item: The object it is believed to be.
        label: Class name.
        position: Centre of the object `(3,)` [m] in the world, at half its known height.
        confidence: The detection's, 0 to 1.
        frame: Id of the frame it was seen in.
        epoch: Change count of the table when it was seen.
        stamp: Time it was seen [s].
    """

    item: Item
    label: str
    position: Array
    confidence: float
    frame: int
    epoch: int
    stamp: float


@dataclass(frozen=True, eq=False)
class Bin:
    """A container objects are sorted into.

    Attributes:
        name: Its name in the cell file.
        position: Centre of its floor `(3,)` [m].
        size: Inner length, width and wall height `(3,)` [m].
        slots: Drop positions over the floor `(N, 2)` [m], used in turn.
    """

    name: str
    position: Array
    size: Array
    slots: Array

    def contains(self, position: Array) -> bool:
        """Tell whether a point `(3,)` [m] lies over the floor."""
        return bool(np.all(np.abs(position[:2] - self.position[:2]) <= self.size[:2] / 2))


@dataclass(frozen=True)
class ObjectClass:
    """What the cell knows of a class of objects.

    Attributes:
        label: Class name, as the detector says it.
        height: Height of the object as it lies on the table [m].
        radius: Radius of the circle around its outline seen from above [m].
    """

    label: str
    height: float
    radius: float


Steps = Iterator[None]
"""What a generator hands the tick loop: one None per control step."""


class Clock(Protocol):
    """The run's only clock; in simulation it advances by physics steps alone."""

    @property
    def now(self) -> float:
        """Time since the run began [s]."""

    @property
    def step(self) -> float:
        """Length of one control step [s]."""

    def sleep(self, duration: float) -> Steps:
        """Yield until `duration` [s] has passed on this clock."""


class Motion(Protocol):
    """A planned and checked arm trajectory, at rest at both ends."""

    @property
    def duration(self) -> float:
        """Time it takes from start to rest [s]."""


@dataclass(frozen=True, eq=False)
class Via:
    """A tool position to pass, tool pointing down.

    Attributes:
        position: Where the tool centre point goes `(3,)` [m].
        yaw: Rotation about the vertical [rad], or None where it is free.
        speed: Longest tool speed on the way to it [m/s], or None for as fast as the limits allow.
    """

    position: Array
    yaw: float | None = None
    speed: float | None = None


class Arm(Protocol):
    """A robot arm that follows planned motions."""

    @property
    def q(self) -> Array:
        """Measured joint positions `(7,)` [rad]."""

    @property
    def tool_pose(self) -> Pose:
        """Pose of the tool centre point in the world, from the joint positions."""

    @property
    def at_rest(self) -> bool:
        """True while no motion runs and no braking is under way."""

    def plan(self, vias: Sequence[Via], carrying: ObjectClass | None = None) -> Motion:
        """Return a motion from where the arm rests through every via.

        Raises:
            Unreachable: A via has no joint solution inside the limits.
            Blocked: The way comes too close to something.
        """

    def plan_to_pose(self, name: str) -> Motion:
        """Return a motion straight up to travel height, then to the named joint pose of the cell file.

        Raises as `plan` does.
        """

    def start(self, motion: Motion) -> None:
        """Begin to follow `motion`; the arm must be at rest where it starts."""

    def stop(self) -> None:
        """Brake along the running motion's path; returns at once, also when nothing runs."""


class Tool(Protocol):
    """A suction tool with a contact and a vacuum sensor."""

    @property
    def touching(self) -> bool:
        """True while the cup's lip is on something."""

    @property
    def holding(self) -> bool:
        """True while the vacuum says that something is sealed to the cup."""

    def close(self) -> None:
        """Switch the vacuum on: what the cup touches now is sealed to it if the seal is good enough."""

    def open(self) -> None:
        """Let go and switch the vacuum off."""


class Camera(Protocol):
    """A camera that can be asked for a frame at any tick."""

    @property
    def name(self) -> str:
        """Its name in the cell file."""

    @property
    def scan_poses(self) -> Sequence[str]:
        """Names of the arm poses from which it sees the table, best first."""

    def next_pose(self) -> str:
        """Return the scan pose after the one this returned last, for a look from elsewhere."""

    def area(self, view: str) -> Box:
        """Return the part of the image [pixel] that `view` (`table` or `full`) means."""

    def sees_table(self) -> bool:
        """Tell whether the whole workspace is in view now, the arm not in front of it."""

    def capture(self) -> Frame:
        """Return a fresh frame."""


class Request(Protocol):
    """A detection under way."""

    @property
    def ready(self) -> bool:
        """True from the tick at which the answer is due on the run's clock."""

    def result(self) -> Sequence[Detection]:
        """Return everything found at or above the detector's floor, most confident first.

        Raises:
            Unavailable: The detector gave no usable answer.
        """


class Detector(Protocol):
    """Finds objects in frames, beside the tick loop."""

    @property
    def threshold(self) -> float:
        """Confidence from which a detection counts."""

    def request(self, frame: Frame, view: str) -> Request:
        """Start to search `frame`: the `table` part or the `full` image."""


class Localizer(Protocol):
    """Turns a detection into a point in the world."""

    def locate(self, detection: Detection, frame: Frame) -> Array:
        """Return the centre of the detected object `(3,)` [m], from the pose stored with the frame.

        Raises:
            NoDepth: The frame has no usable depth where the detection lies.
        """


class Ledger(Protocol):
    """Who is who on the table: the only place where identity, freshness and fate are decided."""

    @property
    def epoch(self) -> int:
        """How often the table has been changed by the robot so far."""

    def is_current(self, frame: Frame) -> bool:
        """Tell whether nothing has put the whole table in doubt since the frame was taken."""

    def observe(self, detections: Detections, positions: Sequence[Array]) -> Sequence[Target]:
        """Record a look and return one target per detection that is not inside a bin.

        `positions` `(3,)` [m] belong to `detections.found` one to one.
        """

    def is_fresh(self, target: Target) -> bool:
        """Tell whether nothing the robot did since has put the target's position in doubt."""

    def is_open(self, item: Item) -> bool:
        """Tell whether the item still waits to be sorted: neither placed, rejected, held nor lost."""

    def believes_empty(self) -> bool:
        """Tell whether enough looks at the full frame agree that nothing with a route is left."""

    def touched(self, item: Item) -> None:
        """Record that the tool met the item, which proves that it exists."""

    def missed(self, item: Item) -> None:
        """Record a grasp that did not hold; where things lie nearby is in doubt now."""

    def held(self, item: Item) -> None:
        """Record that the tool holds the item; its neighbours may have moved."""

    def dropped(self, item: Item) -> None:
        """Record that the tool lost the item on the way; the whole table is in doubt now."""

    def placed(self, item: Item, bin: str) -> None:
        """Record that the item was let go in a bin."""

    def returned(self, item: Item) -> None:
        """Record that the item was put back on the table."""

    def rejected(self, item: Item, why: str) -> None:
        """Record that the item is given up; it is reported and not tried again."""

    def label(self, item: Item) -> str:
        """Return the class the item is believed to be of."""

    def attempts(self, item: Item) -> int:
        """Return how many grasps of the item have failed."""

    def free_slot(self, bin: str) -> int:
        """Return the number of the drop slot of `bin` to use next."""


class Operator(Protocol):
    """The person (or script) beside the cell."""

    def ask(self, choices: Sequence[str]) -> str | None:
        """Return the next thing asked for, one of `choices`, `rescan`, or None to quit.

        The run's clock stands still while the person thinks.
        """


@dataclass(frozen=True)
class Cell:
    """A work cell: everything a skill may use.

    Attributes:
        camera: The camera that watches the table.
        detectors: By name; the first is the default.
        bins: By name.
        classes: What is known of each class of objects, by label.
        routes: Class label to bin name, as the mission says.
        localizer: How detections become positions in this cell.
        safe_place: Where something held may be put down `(3,)` [m].
        travel_height: Height of the tool centre point at which tool and load clear everything [m].
        descent: Length of an approach's guarded last part above the expected surface [m].
        descent_speed: Tool speed of that part [m/s].
        decided: Tells the record which target was chosen and for which bin.
    """

    clock: Clock
    arm: Arm
    tool: Tool
    camera: Camera
    detectors: Mapping[str, Detector]
    ledger: Ledger
    operator: Operator
    bins: Mapping[str, Bin]
    classes: Mapping[str, ObjectClass]
    routes: Mapping[str, str]
    localizer: Localizer
    safe_place: Array
    travel_height: float
    descent: float
    descent_speed: float
    decided: Callable[[Target, str], None]


class Accounts(Protocol):
    """What the runtime asks of a ledger when a run is over."""

    def close(self) -> None:
        """Decide what became of everything still open."""

    def balance(self) -> dict[str, int]:
        """Return the counts `seen, placed, rejected, lost, phantom`."""

    def rows(self) -> list[dict[str, object]]:
        """Return a plain row per item, in the order of first sight."""


class Workcell(Protocol):
    """What the runtime drives: a cell together with the world it acts in."""

    @property
    def cell(self) -> Cell:
        """What skills see."""

    @property
    def accounts(self) -> Accounts:
        """The books of the cell's ledger."""

    def advance(self) -> None:
        """Let one control step pass."""

    def audit(self) -> Mapping[str, int] | None:
        """Return what really became of the objects, or None where nobody can know (real hardware)."""

    def close(self) -> None:
        """Give everything back; the cell cannot be used afterwards."""


@dataclass(frozen=True)
class CellOptions:
    """How a run wants its cell.

    Attributes:
        operator: Who is asked for requests.
        base: Folder that paths in the cell file start from.
        gui: Show the world in a window.
    """

    operator: Operator
    base: Path
    gui: bool = False


KeyPath = tuple[str | int, ...]
"""Keys that lead to a value in a cell file, outermost first."""


class CellKind(Protocol):
    """A class that makes work cells; found by its name in the entry-point group `executive.cells`."""

    def __call__(
        self, config: Any, *, seed: int, routes: Mapping[str, str], emit: Emit, options: CellOptions
    ) -> Workcell:
        """Return a cell made from a cell file (`executive.cell_config.CellConfig`)."""

    def check(self, config: Any) -> Iterable[tuple[KeyPath, str]]:
        """Return what is wrong with a cell file beyond its form: the key it is about, and a sentence."""
