"""Protocols of the parts of a work cell that skills use: clock, tool, camera, detector, ledger, operator.

Through these protocols, a skill runs unchanged in simulation, on the fake cell of the test kit, and on
hardware. No call blocks: a skill sends a request, yields, and reads the result in a later control step.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from executive.cell.arm import Arm
from executive.cell.device_config import MotionConfig
from executive.cell.frame import Answer, BinAppearance, Box, Detection, Detections, Frame, Observation, Region
from executive.cell.ledger import Ledger
from executive.cell.objects import Bin, ObjectClass, Obstacle, Quotas, Target
from executive.cell.tools import ToolModel
from executive.geometry import Array

Steps = Iterator[None]
"""Iterator of an operation, which yields None once per control step until the operation ends."""

Routes = Mapping[str, tuple[str, ...]]
"""Names of the permitted bins of each class, by class label, in the order of the mission file."""


class Clock(Protocol):
    """The only clock of the run, which shows simulated time in simulation."""

    @property
    def now(self) -> float:
        """Time since the start of the run [s]."""

    @property
    def step(self) -> float:
        """Time between two ticks [s]."""

    def sleep(self, duration: float) -> Steps:
        """Yield until the time of the clock has advanced by `duration` [s]."""


class Tool(Protocol):
    """A tool with a contact sensor, a sensor of the grip, and a load cell."""

    @property
    def touching(self) -> bool:
        """True while the tip of the tool touches something."""

    @property
    def holding(self) -> bool:
        """True while the sensor of the grip reports an object."""

    @property
    def holding_force(self) -> float:
        """Maximum force with which the tool holds the object [N], from its sensor; 0 without an object."""

    @property
    def load(self) -> float:
        """Measured downward force of the held object on the tool [N], with noise; at rest, its weight."""

    @property
    def load_std(self) -> float:
        """Standard deviation of one reading of `load` [N]."""

    @property
    def opening(self) -> float:
        """Measured distance between the fingers [m]; 0 for a tool without fingers."""

    def close(self) -> None:
        """Begin to grip, which holds a touched object if the tool can hold it."""

    def open(self, opening: float = 0.0) -> None:
        """Stop to grip, and release the object.

        Fingers move to the distance `opening` [m]; 0: as far as needed to free a held object.
        """


class Camera(Protocol):
    """A camera that can capture a frame in every control step."""

    @property
    def name(self) -> str:
        """Name of the camera in the cell file."""

    @property
    def scan_poses(self) -> Sequence[str]:
        """Names of the arm poses from which the camera sees the table, best first."""

    def next_pose(self) -> str:
        """Advance to the next scan pose, cyclically, and return its name."""

    def get_view_box(self, view: str) -> Box:
        """Return the region of the image [pixel] of a view: `table` (the workspace) or `full`."""

    def sees_table(self) -> bool:
        """Return True if the whole workspace is now in the image and the arm occludes no part of it."""

    def capture(self) -> Frame:
        """Capture and return a new frame.

        Raises:
            WrongImage: The image has another size or format than declared.
        """

    def find_faults(self, frame: Frame, time: float) -> Mapping[str, str]:
        """Return a sentence on a fault of the camera that a frame shows, by its reason; {} without a fault.

        The reasons are `frozen`, if the image is not newer than that of the last frame, and `camera_moved`,
        if the camera is not at its declared pose. `time` is that of the capture on the clock of the run [s].
        """

    def find_unexplained(self, look: Detections, obstacles: Collection[Obstacle]) -> Sequence[Region]:
        """Return the regions of a frame that neither the table nor anything known explains.

        Known are the arm, the bins, the detections and `obstacles`, the known objects on the table.
        """

    def inspect_bins(self, frame: Frame) -> Mapping[str, BinAppearance]:
        """Return what a frame shows of the bins in view, by name."""


class Request(Protocol):
    """Running or finished detection of objects in a frame."""

    @property
    def ready(self) -> bool:
        """True once the detector has finished, with an answer or with an error that `result` raises."""

    def result(self) -> Answer:
        """Return the answer of the detector; only allowed while `ready` is True.

        Raises:
            Crowded: The detector found more boxes than objects fit into the cell.
            Unavailable: The detector gave no usable answer.
        """


class Detector(Protocol):
    """A detector of objects in frames, which runs in parallel with the control loop."""

    def request(self, frame: Frame, view: str) -> Request:
        """Start detection in a view of a frame: `table` (the workspace) or `full` (the whole image)."""


class Localizer(Protocol):
    """Computation of the positions of detected objects in the world."""

    def locate(self, detection: Detection, frame: Frame) -> Array:
        """Return the centre `(3,)` [m] of the detected object in the world.

        Raises:
            NoDepth: The depth image has no usable values at the detection.
        """

    def localize(self, detections: Detections) -> Sequence[Observation]:
        """Return an observation of each confident and each doubtful detection.

        An observation is not confident if the detection is doubtful, or if the size of the box or the height
        of the top of the object contradicts the class.

        Raises:
            NoDepth: The depth image has no usable values at a detection.
        """


class Operator(Protocol):
    """The person or script that requests classes of objects."""

    def ask(self, choices: Sequence[str]) -> str | None:
        """Wait for a request, and return one of `choices` (classes), `rescan`, or None to quit.

        The clock of the run stops while the operator decides.

        Raises:
            Stopped: The run was halted during the wait.
        """


class BehaviourStep(NamedTuple):
    """Result of one step of a behaviour of another project.

    Attributes:
        status: Status after the step: `RUNNING`, `SUCCESS`, `FAILURE` or `INVALID`.
        message: Explanation of a failure, or "".
        values: All values on the blackboard of py_trees after the step, by key (`/count`), and after the
            last step the values of the output ports, by name (`mean`).
    """

    status: str
    message: str
    values: Mapping[str, object]


class Behaviours:
    """Behaviours of other projects, which may read clocks, random numbers, files or networks.

    A run records the result of each step, so that a replay executes no behaviour.
    """

    def execute(self, name: str, step: Callable[[], BehaviourStep]) -> BehaviourStep:  # noqa: ARG002
        """Execute a step of a behaviour of the skill `name`, under which a run records the result."""
        return step()


MinTimes = object
"""Type in signatures of `min_time`, which skills of third parties may still define; nothing calls it."""


@dataclass(frozen=True)
class Cell:
    """A work cell: everything that a skill may use.

    Attributes:
        clock: The clock of the run.
        arm: The robot arm.
        tool: The tool at the flange of the arm.
        camera: The camera that sees the table.
        detectors: Detectors by name; the first is the default.
        ledger: The ledger, which tracks the items of the run.
        operator: The person or script that requests classes of objects.
        bins: Bins by name.
        classes: Known properties of each class of objects, by label.
        routes: Names of the permitted bins by class label, from the mission.
        localizer: The localizer, which computes the positions of detected objects.
        workspace: Smallest and largest corner of the part of the table where objects lie `(2, 2)` [m].
        safe_place: Position on the table for putting down a held object `(3,)` [m].
        tool_model: Grasps, measurements and limits of the tool.
        motion: Heights and speed of guarded motions.
        report_selection: Function that reports a selected target and the name of its bin to the run.
        empty_bins: Function that declares that the bins with the given names have been emptied.
        quotas: Maximum numbers of objects in the bins, from the mission.
        get_weight: Function that returns the mean weight of the objects of a class [N]; 0 if it is unknown.
        behaviours: Behaviours of other projects.
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
    workspace: Array
    safe_place: Array
    tool_model: ToolModel
    motion: MotionConfig
    report_selection: Callable[[Target, str], None]
    empty_bins: Callable[[Sequence[str]], None]
    quotas: Quotas
    get_weight: Callable[[str], float]
    behaviours: Behaviours = field(default_factory=Behaviours)
