"""The protocols a skill sees: what a work cell offers, whatever it is made of.

A skill gets one `Cell` and talks to its parts only through these protocols, so it runs unchanged in
simulation, on the fake cell of the test kit, and on hardware that implements them. Nothing here
blocks: a skill asks, yields, and looks again at the next tick.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from executive.cell.arm import Arm
from executive.cell.values import (
    Answer,
    Bin,
    Box,
    Detection,
    Detections,
    Frame,
    Glimpse,
    Item,
    ObjectClass,
    Target,
)
from executive.geometry import Array

Steps = Iterator[None]
"""What a generator hands the tick loop: one None per control step."""

Routes = Mapping[str, tuple[str, ...]]
"""Class label to the bins it may go to, in the order the mission names them: any of them is right."""


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


class Tool(Protocol):
    """A suction tool with a contact and a vacuum sensor."""

    @property
    def touching(self) -> bool:
        """True while the cup's lip is on something."""

    @property
    def holding(self) -> bool:
        """True while the vacuum says that something is sealed to the cup."""

    @property
    def bears(self) -> float:
        """The pull that the seal bears, as the vacuum gauge tells [N]; 0 while nothing is held."""

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

    def displacement(self, frame: Frame) -> str:
        """Return in words how far a frame shows the camera beside its declared pose; "" if it does not."""


class Request(Protocol):
    """A detection under way."""

    @property
    def ready(self) -> bool:
        """True from the tick at which the answer is due on the run's clock."""

    def result(self) -> Answer:
        """Return what the detector says.

        Raises:
            Unavailable: The detector gave no usable answer.
        """


class Detector(Protocol):
    """Finds objects in frames, beside the tick loop."""

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

    def observe(
        self, detections: Detections, positions: Sequence[Array], glimpses: Sequence[Glimpse] = ()
    ) -> Sequence[Target]:
        """Record a look and return the `targets` that are known now.

        `positions` `(3,)` [m] belong to `detections.found` one to one, `glimpses` to `detections.doubtful`.
        What earlier looks have shown, and nothing has disturbed since, is known too.
        """

    def targets(self) -> Sequence[Target]:
        """Return one target per open item on the table whose place is known now."""

    def is_fresh(self, target: Target) -> bool:
        """Tell whether nothing the robot did since has put the target's position in doubt."""

    def is_open(self, item: Item) -> bool:
        """Tell whether the item still waits to be sorted: neither placed, rejected, held nor lost."""

    def is_sure(self, item: Item) -> bool:
        """Tell whether enough looks agree that the item exists, of which class it is, and where."""

    def in_doubt(self) -> Sequence[Item]:
        """Return the open items in the workspace that a further look may make sure, or show to be gone."""

    def believes_empty(self, label: str | None = None) -> bool:
        """Return True if it is as good as certain that nothing with a route is left where one can look.

        Args:
            label: Only objects of this class count; None: those of all classes.
        """

    @property
    def unknown(self) -> Mapping[str, int]:
        """Largest number of boxes in one look for each label that the cell does not know."""

    def touched(self, item: Item, contradiction: str = "", *, beside_top: bool = False) -> bool:
        """Record that the tool touched an item, and return True if it may be of its class.

        Args:
            item: The item.
            contradiction: How the height of the touch contradicts the class, or ""; a rejection reports it.
            beside_top: True if the touch may have missed the top of the object.
        """

    def missed(self, item: Item, *, found_table: bool = False) -> None:
        """Record a failed attempt to pick an item; the positions of all objects are in doubt now.

        Args:
            item: The item.
            found_table: True if the tool went down almost to the table at the item's place without a contact.
        """

    def held(self, item: Item) -> None:
        """Record that the tool holds the item; its neighbours may have moved."""

    def dropped(self, item: Item, landing: Array | None = None) -> None:
        """Record that the tool lost the item on the way; the whole table is in doubt now.

        `landing` `(3,)` [m] is where it must have come down, None where nobody can tell.
        """

    def placed(self, item: Item, bin: str) -> None:
        """Record that the item was let go in a bin."""

    def returned(self, item: Item, position: Array) -> None:
        """Record that the item was put back on the table, its middle at `position` `(3,)` [m]."""

    def rejected(self, item: Item, why: str) -> None:
        """Record that the item is given up; it is reported and not tried again."""

    def label(self, item: Item) -> str:
        """Return the class the item is believed to be of."""

    def attempts(self, item: Item) -> int:
        """Return how many grasps of the item have failed."""

    def objects_in(self, bin: str) -> int:
        """Return how many objects were let go in `bin` so far: the number of its next free slot."""

    def standing(self) -> Sequence[Target]:
        """Return where everything is that is believed to stand on the table, to be sorted or not."""

    def bumped(self) -> None:
        """Record that the arm ran into something: the whole table is in doubt now."""

    def in_tool(self) -> Item | None:
        """Return the item that the tool is believed to hold, or None."""


class Operator(Protocol):
    """The person (or script) beside the cell."""

    def ask(self, choices: Sequence[str]) -> str | None:
        """Return the next thing asked for, one of `choices`, `rescan`, or None to quit.

        The run's clock stands still while the person thinks.

        Raises:
            Stopped: The run is to end.
        """


class LeastTimes(Protocol):
    """What things take in a cell at the very least [s]: nothing that succeeds there is done sooner.

    Bounds, not estimates: whoever is given less time than this must fail, by whichever way the arm goes.
    """

    @property
    def descent(self) -> float:
        """The guarded last part of an approach, down to an object that lies on the table."""

    def carry(self, bin: str | None) -> float:
        """From where objects lie to above the floor of a bin, at rest at both ends; None: the nearest bin.

        0 for a bin that the cell lacks.
        """

    def answer(self, detector: str) -> float:
        """From a frame to the answer of a detector; "": the first one. 0 for one that the cell lacks."""


@dataclass(frozen=True)
class Cell:
    """A work cell: everything a skill may use.

    Attributes:
        camera: The camera that watches the table.
        detectors: By name; the first is the default.
        bins: By name.
        classes: What is known of each class of objects, by label.
        routes: Class label to the names of the bins that are right for it, as the mission says.
        localizer: How detections become positions in this cell.
        safe_place: Where something held may be put down `(3,)` [m].
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
    routes: Routes
    localizer: Localizer
    safe_place: Array
    descent: float
    descent_speed: float
    decided: Callable[[Target, str], None]
