"""Protocol of the ledger: the items of a run, their state and their position."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from executive.cell.detection import Detections, Observation
from executive.cell.frame import Frame
from executive.cell.objects import Item, Target
from executive.geometry import Array


class Ledger(Protocol):
    """Who is who on the table: the only place where identity, freshness and fate are decided."""

    @property
    def epoch(self) -> int:
        """How often the table has been changed by the robot so far."""

    def is_current(self, frame: Frame) -> bool:
        """Tell whether nothing has put the whole table in doubt since the frame was taken."""

    def observe(self, detections: Detections, observations: Sequence[Observation]) -> Sequence[Target]:
        """Update all items with one search of a frame, and return the `targets` that are known now.

        Targets of earlier frames are included, unless something has disturbed them since.

        Args:
            detections: The frame, the searched area, and the detector's error rates.
            observations: Its detections, localized.
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
