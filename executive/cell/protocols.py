"""Protocols of the parts of a work cell that skills use: clock, tool, camera, detector, ledger, operator.

Through these protocols, a skill runs unchanged in simulation, on the fake cell of the test kit, and on
hardware. No call blocks: a skill sends a request, yields, and reads the result in a later control step.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple, Protocol

from executive.cell.arm import Arm
from executive.cell.device_config import MotionConfig
from executive.cell.frame import Answer, Box, Detection, Detections, Frame, Observation, Region
from executive.cell.objects import Bin, Item, KnownItem, ObjectClass, Obstacle, Quotas, Target
from executive.cell.tools import ToolMeasurement, ToolModel
from executive.geometry import Array


class Presence(Enum):
    """Answer to the question whether an item is at the place where the ledger believes it to be."""

    PRESENT = "present"
    """A frame shows the item at its place."""
    GONE = "gone"
    """Enough frames show the place of the item without the item."""
    HIDDEN = "hidden"
    """The frame does not show the place of the item, or the tool holds the item."""
    UNSURE = "unsure"
    """A detection at the place is doubtful, or too few frames show the place without the item."""


class Ledger(Protocol):
    """Tracker of the items of a run, which decides on the identity, state and position of each object."""

    @property
    def change_count(self) -> int:
        """Number of actions of the robot so far that may have moved objects on the table."""

    @property
    def empty_load(self) -> float:
        """Load of the empty tool before the last approach [N], the zero of a weighing; 0 if it is unknown."""

    @property
    def unknown_labels(self) -> Mapping[str, int]:
        """Labels that are not in the cell file, each with its maximum number of boxes per frame."""

    def observe(self, detections: Detections, observations: Sequence[Observation]) -> Sequence[Target]:
        """Update all items with the detections in a frame, and return the targets (`find_targets`).

        The ledger ignores all detections in a frame of an earlier call, and detections at positions where the
        robot may have moved objects since the capture of the frame.

        Args:
            detections: Detections with their frame, its searched region, and the detector's error rates.
            observations: The same detections, localized in the world.
        """

    def observe_regions(self, look: Detections, regions: Sequence[Region]) -> None:
        """Record the regions of a frame that nothing known explains (`Camera.find_unexplained`).

        The table does not count as empty before several frames have shown or refuted each region. The result
        of the run lists the remaining regions.
        """

    def choose_place_to_probe(self) -> Array | None:
        """Return the centre `(3,)` [m] of an unexplained region that two looks showed, or None.

        Each region is chosen at most once, so that a probe that fails is not repeated.
        """

    def record_probe(self, place: Array, height: float | None) -> None:
        """Record a descent of the tool to the centre of an unexplained region `(3,)` [m].

        `height` is the height of the contact [m]; None if the tool touched nothing.
        """

    def find_targets(self) -> Sequence[Target]:
        """Return a target for each item that still has to be sorted and has a known position."""

    def find_objects_on_table(self) -> Sequence[Target]:
        """Return all items that lie on the table with a probability of at least 0.5, and objects of no item.

        Objects of no item have the label "": objects whose label the cell file ignores, what the arm ran
        into, unless it is an item or a bin, and the regions of `observe_regions`. They are forgotten after
        some frames without them.
        """

    def find_uncertain_items(self) -> Sequence[Item]:
        """Return the unsorted items in the workspace that are uncertain, or that may have been moved."""

    def find_held_item(self) -> Item | None:
        """Return the item in the tool, or None."""

    def is_current(self, frame: Frame) -> bool:
        """Return False if an action since the capture of a frame may have moved any object on the table."""

    def is_fresh(self, target: Target) -> bool:
        """Return False if the robot may have moved a target since its last detection."""

    def is_certain(self, item: Item) -> bool:
        """Return True if the existence, class and position of an item are certain enough to pick it."""

    def is_confirmed_by_tool(self, label: str) -> bool:
        """Return True if a measurement of the tool has agreed with a class before."""

    def is_table_empty(self, label: str | None = None, ignored_items: Collection[Item] = ()) -> bool:
        """Return True if almost certainly no object that the mission still sorts is visible on the table.

        An object is sorted if its class has a route to a bin below its quota. `label` restricts the check to
        objects of one class; None: all classes with a route. The objects in `ignored_items` may be on the
        table.
        """

    def get_label(self, item: Item) -> str:
        """Return the most probable class of an item."""

    def list_possible_labels(self, item: Item) -> Sequence[str]:
        """Return the classes of an item that a weighing may find, the most probable class first.

        Before a weighing, these are all classes that look alike; after a weighing that determined the class,
        only this class.
        """

    def describe(self, item: Item) -> KnownItem:
        """Return the present knowledge about an item."""

    def list_known_items(self) -> Sequence[KnownItem]:
        """Return all items that exist with a probability of at least 0.5, in the order of detection."""

    def count_objects_in(self, bin: str, label: str | None = None) -> int:
        """Return the number of objects in a bin; `label` restricts the count to one class."""

    def count_items(self, state: str, label: str | None = None, bin: str | None = None) -> int:
        """Return the number of items in `state`, which is `placed` or `rejected` (`KnownItem.state`).

        `label` restricts the count to one class, `bin` to one bin.
        """

    def explain_skipped_class(self, label: str) -> str:
        """Return the reason why the mission does not sort further objects of a class, or "".

        There are three reasons: the class has no route, the quotas of its bins are reached, or images
        contradict its bins.
        """

    @property
    def contradicted_bins(self) -> Mapping[str, str]:
        """Contradictions between images and the declared bins, by name of the bin."""

    def has_unconfirmed_bin(self) -> bool:
        """Return True if no image has shown one of the bins as declared, or as contradicted, so far."""

    def record_bin_contents(self, contents: Mapping[str, tuple[float, bool]], frame: Frame) -> None:
        """Record the result of `Camera.measure_bins`: it changes only if the robot brings an object."""

    def record_bins(self, contradictions: Mapping[str, str], frame: Frame) -> None:
        """Record the result of `Camera.check_bins`; it replaces earlier results for the same bins."""

    def find_next_slot_index(self, bin: str) -> int:
        """Return the index of the next free slot of a bin, behind the slots of all objects in the bin.

        Slots are filled in order: a slot whose object was taken out is not filled again while a later slot
        contains an object.
        """

    def update_presence(
        self, item: Item, detections: Detections, observations: Sequence[Observation]
    ) -> Presence:
        """Record whether a frame shows an item at its place, and return its presence.

        The item is gone if the probability that all frames so far missed the item by chance is small enough,
        given the miss rates of the detectors. Its position is then unknown: the item counts as dropped until
        a frame shows an object of its class at a new place.

        Args:
            item: The item.
            detections: Detections in a frame, for which `observe` was called before. The searched region is
                the full image, or contains the place of the item.
            observations: The same detections, localized in the world.
        """

    @property
    def is_tool_plausible(self) -> bool:
        """False after several failed picks if none has succeeded: a sensor of the tool may be broken."""

    def record_empty_load(self, load: float) -> None:
        """Record the load of the empty tool at rest [N]."""

    def record_measurement(self, item: Item, measurement: ToolMeasurement) -> bool:
        """Record a contact with an item, and return False if its measurement contradicts the class."""

    def record_weight(self, item: Item, weight: float, std: float) -> str:
        """Record the weight of an item, which determines its class among the classes that look alike.

        Return "" if the class is then certain, otherwise a sentence that states the contradiction.

        Args:
            item: The item.
            weight: Measured weight [N].
            std: Standard deviation of the error of the measurement [N].
        """

    def record_failed_pick(self, item: Item, *, found_table: bool = False) -> None:
        """Record a failed attempt to pick an item, which may have moved any object on the table.

        `found_table` is True if the descent to the item touched nothing above the table.
        """

    def record_grasp(self, item: Item) -> None:
        """Record that the tool holds an item; the grasp may have moved neighbouring objects.

        Raises:
            Fault: According to the ledger, the tool still holds another item.
        """

    @property
    def false_grasp_count(self) -> int:
        """Number of grasps that load or looks contradicted since a load confirmed a grasp."""

    def record_held_load(self) -> None:
        """Record that the load of the tool confirmed the last grasp."""

    def record_false_grasp(self, item: Item) -> None:
        """Record that the tool held nothing, or something else than the item, since its grasp."""

    def record_drop(self, item: Item, landing: Array | None = None) -> None:
        """Record that the tool lost an item, which may have moved any object on the table.

        `landing` is the predicted landing position `(3,)` [m]; None if it is unknown.
        """

    def record_placement(self, item: Item, bin: str) -> None:
        """Record that an item was released in a bin."""

    def empty_bins(self, bins: Collection[str]) -> None:
        """Record that bins have been emptied: their items stay placed, but are no longer in a bin."""

    def record_put_down(self, item: Item, position: Array) -> None:
        """Record that an item was put back on the table, with its centre at `position` `(3,)` [m]."""

    def reject(self, item: Item, reason: str) -> None:
        """Reject an item: skills no longer select the item, and the result of the run lists the item."""

    def defer(self, item: Item) -> None:
        """Defer an item: the item stays open, and skills select it only after every other candidate."""

    def invalidate_positions(self) -> None:
        """Record that the robot may have moved any object on the table."""

    def record_collision(self, point: Sequence[float] | None) -> None:
        """Record a collision of the arm, which may have moved any object on the table.

        `point` is the contact point `(x, y, z)` [m]; None if it is unknown.
        """


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

    def close(self) -> None:
        """Begin to grip, which holds a touched object if the tool can hold it."""

    def open(self) -> None:
        """Stop to grip, and release the object."""


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

    def describe_standstill(self, frame: Frame, time: float) -> str:
        """Return a sentence if a frame shows no newer image than the last frame, else "".

        `time` is the time of the capture on the clock of the run [s].
        """

    def find_unexplained(self, look: Detections, obstacles: Collection[Obstacle]) -> Sequence[Region]:
        """Return the regions of a frame that neither the table nor anything known explains.

        Known are the arm, the bins, the detections and `obstacles`, the known objects on the table.
        """

    def measure_bins(self, frame: Frame) -> Mapping[str, tuple[float, bool]]:
        """Return what a frame shows on the floors of the bins, by name.

        The values are the area [m²] that differs from the floor, and True if the whole floor is in view.
        A bin of which too little is in view is missing in the result.
        """

    def describe_displacement(self, frame: Frame) -> str:
        """Return a sentence if a frame shows that the camera is not at its declared pose, else ""."""

    def check_bins(self, frame: Frame) -> Mapping[str, str]:
        """Return what a frame shows of bins by name: "" for a bin that is as declared, else a contradiction.

        A bin that the frame does not show well enough is missing in the result.
        """


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
    safe_place: Array
    tool_model: ToolModel
    motion: MotionConfig
    report_selection: Callable[[Target, str], None]
    empty_bins: Callable[[Sequence[str]], None]
    quotas: Quotas
    get_weight: Callable[[str], float]
    behaviours: Behaviours = field(default_factory=Behaviours)
