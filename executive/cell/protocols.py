"""Protocols of the parts of a work cell that skills use.

A skill uses the parts of its `Cell` only through these protocols, so it runs unchanged in simulation, on the
fake cell of the test kit, and on hardware. No call blocks: a skill sends a request, yields, and reads the
result in a later control step.
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
"""Generator that yields None once per control step."""

Routes = Mapping[str, tuple[str, ...]]
"""Class label to the bins that are right for it, in the order of the mission."""


class Clock(Protocol):
    """The only clock of the run; in simulation it advances with the physics steps."""

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
        """True while the lip of the cup touches something."""

    @property
    def holding(self) -> bool:
        """True while the vacuum sensor reports a seal."""

    @property
    def holding_force(self) -> float:
        """Largest force that the seal withstands, by the vacuum gauge [N]; 0 without a seal."""

    def close(self) -> None:
        """Switch the vacuum on, which seals the touched object to the cup if its surface allows."""

    def open(self) -> None:
        """Switch the vacuum off and release the object."""


class Camera(Protocol):
    """A camera that returns a frame in any control step."""

    @property
    def name(self) -> str:
        """Name in the cell file."""

    @property
    def scan_poses(self) -> Sequence[str]:
        """Names of the arm poses from which the camera sees the table, best first."""

    def next_pose(self) -> str:
        """Return the next scan pose in turn, for a look from another viewpoint."""

    def get_view_box(self, view: str) -> Box:
        """Return the part of the image [pixel] that a view shows: `table` (the workspace) or `full`."""

    def sees_table(self) -> bool:
        """Return True if the whole workspace is in view now, and the arm does not hide any part of it."""

    def capture(self) -> Frame:
        """Return a new frame."""

    def describe_displacement(self, frame: Frame) -> str:
        """Return a sentence about the displacement of the camera that a frame shows, or ""."""


class Request(Protocol):
    """Search of a frame by a detector, in progress or finished."""

    @property
    def ready(self) -> bool:
        """True from the control step in which the answer is due."""

    def result(self) -> Answer:
        """Return the answer of the detector, once `ready` is True.

        Raises:
            Crowded: The detector found more boxes than there can be objects.
            Unavailable: The detector gave no usable answer.
        """


class Detector(Protocol):
    """Finds objects in frames, in parallel to the tick loop."""

    def request(self, frame: Frame, view: str) -> Request:
        """Begin to search a view of a frame: `table` (the workspace) or `full` (the whole image)."""


class Localizer(Protocol):
    """Finds the positions of detected objects in the world."""

    def locate(self, detection: Detection, frame: Frame) -> Array:
        """Return the centre of the detected object `(3,)` [m] in the world, by the camera pose of the frame.

        Raises:
            NoDepth: The frame has no usable depth at the detection.
        """

    def localize(self, detections: Detections) -> Sequence[Observation]:
        """Return an observation of each found or doubtful detection.

        An observation is not confident if its detection is doubtful, or if the size of its box or the height
        of its top contradicts its class.

        Raises:
            NoDepth: The frame has no usable depth at a detection.
        """


class Operator(Protocol):
    """The person or script that requests objects."""

    def ask(self, choices: Sequence[str]) -> str | None:
        """Return the next request: one of `choices` (classes), `rescan`, or None to quit.

        The clock of the run stands still until the answer.

        Raises:
            Stopped: The run has to halt.
        """


class MinTimes(Protocol):
    """Lower bounds of the times of actions in a cell [s].

    An action with a shorter timeout always fails.
    """

    @property
    def descent_time(self) -> float:
        """Time of the guarded last part of an approach to an object on the table [s]."""

    def get_transport_time(self, bin: str | None) -> float:
        """Return the time from the workspace to a bin [s], from rest to rest; None: the nearest bin.

        0 for a bin that the cell lacks.
        """

    def get_answer_time(self, detector: str) -> float:
        """Return the time from a frame to the answer [s]; "": the first detector; 0 for an unknown one."""


@dataclass(frozen=True)
class Cell:
    """A work cell: everything a skill may use.

    Attributes:
        clock: The clock of the run.
        arm: The robot arm.
        tool: The tool at the flange of the arm.
        camera: The camera that sees the table.
        detectors: Detectors by name; the first is the default.
        ledger: The items of the run.
        operator: The person or script that requests objects.
        bins: Bins by name.
        classes: Known properties of each class of objects, by label.
        routes: Class label to the names of the bins that are right for it, by the mission.
        localizer: Finds the positions of detections.
        safe_place: Place on the table for a put-down `(3,)` [m].
        descent: Length of the guarded last part of an approach above the expected surface [m].
        descent_speed: Tool speed of the guarded part [m/s].
        report_selection: Reports a target that a skill has selected, and the name of its bin, to the run.
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
    report_selection: Callable[[Target, str], None]
