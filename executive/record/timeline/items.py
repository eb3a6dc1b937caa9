"""History of the items of a run: changes by the ledger, looks and failures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from executive.events import DetectedObject, FrameSearched, ItemChanged
from executive.record.timeline.activation import Activation


@dataclass(frozen=True)
class Look:
    """Camera image in which a detector searched (a look).

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
    """Look in which an item was detected.

    Attributes:
        frame, camera, detector, clock: Number of the frame, name of the camera, name of the detector, and
            time of the look [s].
        item: Name of the item.
        attempts: Number of failed attempts to pick the item.
        looks: Number of looks in which the item was detected.
        label, confidence, position: Class, confidence and position `(3,)` [m] of the nearest detection; None
            if the look has no confident detection.
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
class ItemHistory:
    """History of one item.

    Attributes:
        last_change: Last event of a change of the item.
        last_change_number: Number of the last state change of the item, among all state changes in the run.
        state_at_tree_end: State of the item at the end of the tree, before the ledger set the final states.
        sighting: Last look in which the item was detected, or None.
        unseen_look_count: Number of looks after `sighting`.
        pick_time, drop_time: Last times at which the tool picked and dropped the item [s], or None.
        failure: Last failed activation of a skill that worked on the item, or None.
    """

    last_change: ItemChanged
    last_change_number: int = 0
    state_at_tree_end: str = ""
    sighting: Sighting | None = None
    unseen_look_count: int = 0
    pick_time: float | None = None
    drop_time: float | None = None
    failure: Activation | None = None


@dataclass
class ItemsTimeline:
    """History of all items, updated from the events of a run.

    Attributes:
        by_name: History of each item by name, in the order of the first changes.
        look: The last look, or None.
        classes: Detected classes as keys, in the order of their first detections.
    """

    by_name: dict[str, ItemHistory] = field(default_factory=dict)
    look: Look | None = None
    classes: dict[str, None] = field(default_factory=dict)
    _change_count: int = 0
    _newly_seen: list[str] = field(default_factory=list)

    def add_change(self, event: ItemChanged, clock: float, *, is_after_tree_end: bool) -> None:
        """Add a change of an item at the time `clock` [s], during the tree or after its end."""
        item = self.by_name.get(event.item)
        last_state, look_count = (item.last_change.state, item.last_change.looks) if item else ("", 0)
        item = self.by_name.setdefault(event.item, ItemHistory(event))
        if event.looks > look_count:
            self._newly_seen.append(event.item)
        if event.state != last_state:
            self._change_count += 1
            item.last_change_number = self._change_count
            if event.state == "held":
                item.pick_time = clock
            elif event.state == "dropped":
                item.drop_time = clock
        item.last_change = event
        if not is_after_tree_end:
            item.state_at_tree_end = event.state

    def add_look(self, event: FrameSearched, clock: float) -> None:
        """Add a look at the time `clock` [s], after `add_change` has added the changes of its items."""
        self.look = Look(event.frame, event.camera, event.detector, clock, len(event.confident))
        # The classes of a look are sorted, so that most runs of a mission have the same order of classes.
        self.classes |= dict.fromkeys(sorted(found.label for found in event.confident))
        for item in self.by_name.values():
            item.unseen_look_count += 1
        for name in self._newly_seen:
            item = self.by_name[name]
            item.sighting = _make_sighting(self.look, item.last_change, event.confident)
            item.unseen_look_count = 0
        self._newly_seen.clear()

    def find_in_states(self, *states: str) -> dict[str, ItemHistory]:
        """Return the items by name that had one of the given states at the end of the tree.

        Items that the ledger afterwards found to be placed or phantoms are not returned.
        """
        return {
            name: item
            for name, item in self.by_name.items()
            if item.state_at_tree_end in states and item.last_change.state not in ("placed", "phantom")
        }

    def list_items(self) -> list[ItemChanged]:
        """Return the last change of each item."""
        return [item.last_change for item in self.by_name.values()]


def _make_sighting(look: Look, change: ItemChanged, found: Sequence[DetectedObject]) -> Sighting:
    nearest = min(found, key=lambda seen: math.dist(seen.position, change.position), default=None)
    detection = (None,) * 3 if nearest is None else (nearest.label, nearest.confidence, nearest.position)
    look_fields = (look.frame, look.camera, look.detector, look.clock)
    return Sighting(*look_fields, change.item, change.attempts, change.looks, *detection)
