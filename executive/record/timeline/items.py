"""Events of items: changes by the ledger, looks and failures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from executive.events import DetectedObject, FrameSearched, ItemChanged
from executive.record.timeline.activation import Activation


@dataclass(frozen=True)
class Look:
    """A frame in which the detector searched.

    Attributes:
        frame: Number of the frame.
        camera: Name of the camera.
        detector: Name of the detector.
        clock: Time of the look [s].
        found: Number of confident detections.
    """

    frame: int
    camera: str
    detector: str
    clock: float
    found: int


@dataclass(frozen=True)
class Sighting:
    """Look that showed an item.

    Attributes:
        frame, camera, detector, clock: As in `Look`.
        item: Name of the item.
        attempts: Number of failed attempts to pick the item.
        looks: Number of looks that showed the item.
        label, confidence, position: Class, confidence and position `(3,)` [m] of the nearest detection; None
            if there is none.
    """

    frame: int
    camera: str
    detector: str
    clock: float
    item: str
    attempts: int
    looks: int
    label: str | None
    confidence: float | None
    position: Sequence[float] | None


@dataclass
class ItemTimeline:
    """Events of one item.

    Attributes:
        now: Last change of the item.
        changed: Number of the last change of state of the item, among all changes of state in the run.
        final_state: State of the item at the end of the tree, before the ledger closed its accounts.
        sighting: Last look that showed the item, or None.
        unseen: Number of looks after `sighting`.
        held, dropped: Last times at which the tool picked and lost the item [s], or None.
        failure: Last failed activation of a skill that worked on the item, or None.
    """

    now: ItemChanged
    changed: int = 0
    final_state: str = ""
    sighting: Sighting | None = None
    unseen: int = 0
    held: float | None = None
    dropped: float | None = None
    failure: Activation | None = None


@dataclass
class ItemsTimeline:
    """Fold of the events of all items.

    Attributes:
        by_name: Events of each item by name, in the order of their first looks.
        look: The last look, or None.
        classes: Classes that were detected, in the order of the looks that detected them first (a dict as
            an ordered set).
    """

    by_name: dict[str, ItemTimeline] = field(default_factory=dict)
    look: Look | None = None
    classes: dict[str, None] = field(default_factory=dict)
    _changes: int = 0
    _seen_now: list[str] = field(default_factory=list)

    def change(self, event: ItemChanged, clock: float, *, is_final: bool) -> None:
        """Add a change of an item at the time `clock` [s]; `is_final` is True after the end of the tree."""
        item = self.by_name.get(event.item)
        before, looks = (item.now.state, item.now.looks) if item else ("", 0)
        item = self.by_name.setdefault(event.item, ItemTimeline(event))
        if event.looks > looks:
            self._seen_now.append(event.item)
        if event.state != before:
            self._changes += 1
            item.changed = self._changes
            if event.state == "held":
                item.held = clock
            elif event.state == "dropped":
                item.dropped = clock
        item.now = event
        if not is_final:
            item.final_state = event.state

    def add_look(self, event: FrameSearched, clock: float) -> None:
        """Add a look at the time `clock` [s]; the items that it showed have changed before."""
        self.look = Look(event.frame, event.camera, event.detector, clock, len(event.found))
        # The classes are sorted, so that most runs have the same order.
        self.classes |= dict.fromkeys(sorted(found.label for found in event.found))
        for item in self.by_name.values():
            item.unseen += 1
        for name in self._seen_now:
            item = self.by_name[name]
            item.sighting, item.unseen = _make_sighting(self.look, item.now, event.found), 0
        self._seen_now.clear()

    def find_in_states(self, *states: str) -> dict[str, ItemTimeline]:
        """Return the items by name that had one of the given states at the end of the tree.

        The accounts of the ledger may prove afterwards that an item is placed or was a phantom.
        """
        return {
            name: item
            for name, item in self.by_name.items()
            if item.final_state in states and item.now.state not in ("placed", "phantom")
        }

    def now(self) -> list[ItemChanged]:
        """Return the last change of each item."""
        return [item.now for item in self.by_name.values()]


def _make_sighting(look: Look, now: ItemChanged, found: Sequence[DetectedObject]) -> Sighting:
    nearest = min(found, key=lambda seen: math.dist(seen.position, now.position), default=None)
    detection = (None,) * 3 if nearest is None else (nearest.label, nearest.confidence, nearest.position)
    look_fields = (look.frame, look.camera, look.detector, look.clock)
    return Sighting(*look_fields, now.item, now.attempts, now.looks, *detection)
