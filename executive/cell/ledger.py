"""The ledger as skills see it: what the run knows about each object, and records of the robot's actions."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from enum import Enum
from typing import Protocol

from executive.cell.frame import BinAppearance, Detections, Frame, Observation, Region
from executive.cell.objects import Item, KnownItem, Target
from executive.cell.tools import ToolMeasurement
from executive.geometry import Array, HeldPose


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

    def observe_bins(self, appearances: Mapping[str, BinAppearance], frame: Frame) -> None:
        """Record what a frame shows of the bins (`Camera.inspect_bins`).

        The result of the run lists contradictions, and contents that changed although the robot did not act.
        """

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

    def get_held_pose(self, item: Item) -> HeldPose | None:
        """Return the place of an item relative to the tool at its last grasp; None if its yaw is unknown."""

    def record_grasp(self, item: Item, held_pose: HeldPose | None = None) -> None:
        """Record that the tool holds an item; the grasp may have moved neighbouring objects.

        `held_pose` is the place of the item relative to the tool; None if its yaw is unknown.

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
