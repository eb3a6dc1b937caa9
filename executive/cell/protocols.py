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
from executive.cell.bins import Bin
from executive.cell.detection import Answer, Detection, Detections, Observation
from executive.cell.frame import Box, Frame
from executive.cell.ledger import Ledger
from executive.cell.objects import ObjectClass, Target
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
        """Return the answer of the detector.

        Raises:
            Crowded: The detector found more boxes than there can be objects.
            Unavailable: The detector gave no usable answer.
        """


class Detector(Protocol):
    """Finds objects in frames, beside the tick loop."""

    def request(self, frame: Frame, view: str) -> Request:
        """Start to search `frame`: the `table` part or the `full` image."""


class Localizer(Protocol):
    """Finds the positions of detected objects in the world."""

    def locate(self, detection: Detection, frame: Frame) -> Array:
        """Return the centre of the detected object `(3,)` [m], from the camera pose of the frame.

        Raises:
            NoDepth: The frame has no usable depth where the detection lies.
        """

    def localize(self, detections: Detections) -> Sequence[Observation]:
        """Return an observation of each found or doubtful detection.

        An observation is not confident if its detection is doubtful, or if the size of its box or the height
        of its top contradicts its class.

        Raises:
            NoDepth: The frame has no usable depth where a detection lies.
        """


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
