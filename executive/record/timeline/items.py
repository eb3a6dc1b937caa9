"""History of the items of a run: state changes, looks and failures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from executive.events import DetectedObject, FrameSearched, ItemChanged
from executive.record.timeline.activation import Activation


@dataclass(frozen=True)
class Look:
    """Look: camera image with the detections of one detector.

    Attributes:
        frame: Number of the frame.
        camera, detector: Names of the camera and of the detector.
        clock: Time of the look on the clock of the run [s].
        found: Number of confident detections.
    """

    frame: int
    camera: str
    detector: str
    clock: float
    found: int


@dataclass(frozen=True)
class Sighting:
    """Detection of an item in a look.

    Attributes:
        frame, camera, detector, clock: Number of the frame, names of camera and detector, time [s].
        item: Name of the item.
        attempts: Number of failed attempts to pick the item.
        looks: Number of looks in which the item was detected, including this look.
        label, confidence: Class and confidence of the detection nearest to the item, or None.
        position: Position `(3,)` of the detection nearest to the item [m], or None.
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
        last_change: Last event that changed the item.
        last_change_number: Sequence number of the item's last state change among those of all items.
        state_change_time: Time of the item's last state change [s].
        state_at_tree_end: State of the item at the end of the tree; the ledger sets final states afterwards.
        sighting: Last look in which the item was detected, or None.
        unseen_look_count: Number of looks after `sighting`.
        pick_time, drop_time: Times of the last pick and the last drop of the item [s], or None.
        failure: Last failed activation of a skill that worked on the item, or None.
    """

    last_change: ItemChanged
    last_change_number: int = 0
    state_change_time: float = 0.0
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
        look: Last look, or None.
        classes: Detected classes as keys, in the order of their first detections.
        _state_change_count: Number of state changes of all items.
        _detected_items: Names of the items that were detected in the current look.
    """

    by_name: dict[str, ItemHistory] = field(default_factory=dict)
    look: Look | None = None
    classes: dict[str, None] = field(default_factory=dict)
    _state_change_count: int = 0
    _detected_items: list[str] = field(default_factory=list)

    def add_change(self, event: ItemChanged, clock: float, *, is_after_tree_end: bool) -> None:
        """Add a change of an item at the time `clock` [s]."""
        item = self.by_name.get(event.item)
        last_state, look_count = (item.last_change.state, item.last_change.looks) if item else ("", 0)
        item = self.by_name.setdefault(event.item, ItemHistory(event))
        if event.looks > look_count:
            self._detected_items.append(event.item)
        if event.state != last_state:
            self._state_change_count += 1
            item.last_change_number = self._state_change_count
            item.state_change_time = clock
            if event.state == "held":
                item.pick_time = clock
            elif event.state == "dropped":
                item.drop_time = clock
        item.last_change = event
        if not is_after_tree_end:
            item.state_at_tree_end = event.state

    def add_look(self, event: FrameSearched, clock: float) -> None:
        """Add a look at the time `clock` [s], after `add_change` added the changes of all detected items."""
        self.look = Look(event.frame, event.camera, event.detector, clock, len(event.confident))
        # The colours follow the order of `classes`; sorting keeps them equal in most runs of a mission.
        self.classes |= dict.fromkeys(sorted(detection.label for detection in event.confident))
        for item in self.by_name.values():
            item.unseen_look_count += 1
        for name in self._detected_items:
            item = self.by_name[name]
            item.sighting = _make_sighting(self.look, item.last_change, event.confident)
            item.unseen_look_count = 0
        self._detected_items.clear()

    def find_items_in_states(self, *states: str) -> dict[str, ItemHistory]:
        """Return the items whose state at the tree's end is in `states`, except placed items and phantoms."""
        return {
            name: item
            for name, item in self.by_name.items()
            if item.state_at_tree_end in states and item.last_change.state not in ("placed", "phantom")
        }

    def list_items(self) -> list[ItemChanged]:
        """Return the last event of each item, in the order of the first changes."""
        return [item.last_change for item in self.by_name.values()]


def _make_sighting(look: Look, item: ItemChanged, detections: Sequence[DetectedObject]) -> Sighting:
    """Return the sighting of `item` with the detection nearest to its position."""
    nearest = min(detections, key=lambda box: math.dist(box.position, item.position), default=None)
    detection = (nearest.label, nearest.confidence, nearest.position) if nearest else (None, None, None)
    look_fields = (look.frame, look.camera, look.detector, look.clock)
    return Sighting(*look_fields, item.item, item.attempts, item.looks, *detection)
