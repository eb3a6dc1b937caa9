"""Protocol of the ledger: the items of a run, their state and their position."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from executive.cell.detection import Detections, Observation
from executive.cell.frame import Frame
from executive.cell.objects import Item, Target
from executive.geometry import Array


class Ledger(Protocol):
    """Items of a run: the only part that decides identity, freshness and final state of an object."""

    @property
    def epoch(self) -> int:
        """Number of changes of the table by the robot."""

    @property
    def unknown(self) -> Mapping[str, int]:
        """Largest number of boxes in one look for each label that the cell does not know."""

    def observe(self, detections: Detections, observations: Sequence[Observation]) -> Sequence[Target]:
        """Update all items with one search of a frame, and return all targets (`find_targets`).

        Objects in bins are no targets. Detections at positions that the robot changed after the capture do
        not count. A second search of the same frame does not count either.

        Args:
            detections: The frame, the searched area, and the detector's error rates.
            observations: The localized detections.
        """

    def find_targets(self) -> Sequence[Target]:
        """Return one target per open item on the table whose position is known now."""

    def find_objects_on_table(self) -> Sequence[Target]:
        """Return all items that lie on the table with a probability of at least 0.5."""

    def find_uncertain_items(self) -> Sequence[Item]:
        """Return the open items in the workspace that a further look may confirm or show to be gone."""

    def find_held_item(self) -> Item | None:
        """Return the item in the tool, or None."""

    def is_current(self, frame: Frame) -> bool:
        """Return True if no change after the capture of a frame has put all positions in doubt."""

    def is_fresh(self, target: Target) -> bool:
        """Return True if no change after the last detection of a target may have moved it."""

    def is_open(self, item: Item) -> bool:
        """Return True if an item is still to be sorted: not placed, rejected, held or lost."""

    def is_sure(self, item: Item) -> bool:
        """Return True if the existence, class and position of an item are certain enough to pick it."""

    def is_table_empty(self, label: str | None = None) -> bool:
        """Return True if no object with a route is left on the visible table, with the required probability.

        Args:
            label: Only objects of this class count; None: those of all classes.
        """

    def get_label(self, item: Item) -> str:
        """Return the most probable class of an item."""

    def count_attempts(self, item: Item) -> int:
        """Return the number of failed attempts to pick an item."""

    def count_in(self, bin: str) -> int:
        """Return the number of objects in a bin, which is the index of its next free slot."""

    def record_touch(self, item: Item, contradiction: str = "", *, may_miss_top: bool = False) -> bool:
        """Record that the tool touched an item, and return True if it may be of its class.

        Args:
            item: The item.
            contradiction: How the height of the touch contradicts the class, or ""; a rejection reports it.
            may_miss_top: True if the touch may have missed the top of the object.
        """

    def record_miss(self, item: Item, *, found_table: bool = False) -> None:
        """Record a failed attempt to pick an item; all positions are in doubt now.

        Args:
            item: The item.
            found_table: True if the tool descended almost to the table there without a contact.
        """

    def record_grasp(self, item: Item) -> None:
        """Record that the tool holds an item; its neighbours may have been moved."""

    def record_drop(self, item: Item, landing: Array | None = None) -> None:
        """Record that the tool lost an item on the way; all positions are in doubt now.

        `landing` `(3,)` [m] is the predicted position of the item, None if it is unknown.
        """

    def record_placement(self, item: Item, bin: str) -> None:
        """Record that an item was released in a bin."""

    def record_put_down(self, item: Item, position: Array) -> None:
        """Record that an item was put back on the table, with its centre at `position` `(3,)` [m]."""

    def reject(self, item: Item, reason: str) -> None:
        """Reject an item: it is reported and not tried again."""

    def invalidate_positions(self) -> None:
        """Record that any object on the table may have been moved."""

    def lose_track(self) -> None:
        """Record that the tool may have moved any item that is not in a bin."""

    def mark_unseen_as_dropped(self) -> None:
        """Record as dropped every item that no look has shown since `lose_track`.

        Looks search for the item on the table and in the bins. An item that is not found is rejected at the
        end of the run, because its place is unknown.
        """

    def record_bin_contents(self) -> None:
        """Record an item for each object that most full looks since `lose_track` have shown in a bin.

        Objects that the ledger knows to be in the bin do not count. Each other object is assigned to a
        dropped item, or becomes a new item.
        """
