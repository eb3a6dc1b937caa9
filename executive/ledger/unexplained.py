"""What images or sensors show, and no item explains: regions of the table, contents of bins, empty picks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from executive.cell.frame import Detections, Region
from executive.cell.json_values import round_values
from executive.events import Emit, UnexplainedChanged
from executive.geometry import Array

SETTLING_LOOK_COUNT = 3
"""Number of looks at a region after which further looks tell nothing new."""
MAX_UNSETTLED_LOOK_COUNT = 6
"""Maximum number of looks in a row for which a run waits: a region may come and go with the noise."""


@dataclass(eq=False)
class Entry:
    """Something that no item explains.

    Attributes:
        event: Last event about it.
        position: Position `(3,)` [m] of a region of the table; None for anything else.
        look_count: Number of looks that showed the region.
        miss_count: Number of looks at its position that did not show it.
        is_probed: True if a skill has chosen the region for a probe.
        touch_height: Height at which the tool touched it [m]; None without a touch.
    """

    event: UnexplainedChanged
    position: Array | None = None
    look_count: int = 0
    miss_count: int = 0
    is_probed: bool = False
    touch_height: float | None = None

    @property
    def is_settled(self) -> bool:
        """True if a further look tells nothing new."""
        is_touched = self.position is None or self.touch_height is not None
        return is_touched or self.look_count + self.miss_count >= SETTLING_LOOK_COUNT


class Unexplained:
    """All that no item explains; a run with an open entry does not succeed.

    `emit` receives an event for each new or changed entry.
    """

    def __init__(self, emit: Emit) -> None:
        self._emit = emit
        self._entries: dict[str, Entry] = {}
        self._count = 0
        self._unsettled_look_count = 0
        self._flat_places: list[Array] = []
        """Positions `(3,)` [m] of regions at which the tool touched nothing."""

    @property
    def events(self) -> list[UnexplainedChanged]:
        """Last event of each open entry, in the order of their discovery."""
        return [entry.event for entry in self._entries.values()]

    @property
    def positions(self) -> list[Array]:
        """Position `(3,)` [m] of each region of the table."""
        return [entry.position for entry in self._entries.values() if entry.position is not None]

    @property
    def needs_look(self) -> bool:
        """True if a further look may explain a region of the table."""
        return 0 < self._unsettled_look_count < MAX_UNSETTLED_LOOK_COUNT

    def choose_place_to_probe(self) -> Array | None:
        """Return the position `(3,)` [m] of a region that two looks showed, at most once, or None."""
        for entry in self._entries.values():
            if entry.look_count >= 2 and not entry.is_probed:
                entry.is_probed = True
                return entry.position
        return None

    def record_probe(self, place: Array, height: float | None) -> None:
        """Record that the tool touched the region at `place` `(3,)` [m] at a height [m]; None: nothing."""
        for key, entry in list(self._entries.items()):
            if entry.position is place and height is None:
                self._flat_places.append(place)
                self._close(key)
            elif entry.position is place:
                entry.touch_height = height

    def report(self, key: str, text: str, frame: int = 0) -> None:
        """Open an entry, or replace its text; an empty text closes it, because it has been explained.

        Args:
            key: Key of the entry, for instance `bin red_bin`.
            text: Sentence for the result of the run, or "".
            frame: Number of the frame that shows it; 0 for none.
        """
        if not text:
            self._close(key)
            return
        entry = self._entries.get(key) or self._open(key)
        if entry.event.text != text:
            entry.event = UnexplainedChanged(entry.event.name, text, [], frame)
            self._emit(entry.event)

    def observe(self, look: Detections, regions: Sequence[Region], max_distance: float) -> None:
        """Update the regions of the table with those that a look shows.

        A region that as many looks have missed as shown is closed.

        Args:
            look: The look, which determines which positions are in view.
            regions: Regions of its frame that neither the empty table nor an item explains.
            max_distance: Maximum distance between two observations of one region [m].
        """
        new_regions = [
            region
            for region in regions
            if all(math.dist(region.position[:2], place[:2]) > max_distance for place in self._flat_places)
        ]
        for key, entry in list(self._entries.items()):
            if entry.position is None:
                continue
            position = entry.position
            distances = [math.dist(position[:2], region.position[:2]) for region in new_regions]
            if distances and min(distances) <= max_distance:
                self._show(entry, new_regions.pop(distances.index(min(distances))), look.frame.id)
            elif look.compute_searched_mask(position[None])[0]:
                entry.miss_count += 1
                if entry.miss_count >= entry.look_count:
                    self._close(key)
        for region in new_regions:
            self._show(self._open(f"region {self._count + 1}"), region, look.frame.id)
        self._unsettled_look_count += 1
        if all(entry.is_settled for entry in self._entries.values()):
            self._unsettled_look_count = 0

    def _open(self, key: str) -> Entry:
        """Return a new entry with the next name; the caller emits its first event."""
        self._count += 1
        self._entries[key] = Entry(UnexplainedChanged(f"unexplained-{self._count}", "", []))
        return self._entries[key]

    def explain(self, position: Array, max_distance: float) -> bool:
        """Close the settled regions within `max_distance` [m] of an item; return True if there was one."""
        keys = [
            key
            for key, entry in self._entries.items()
            if entry.position is not None
            and entry.look_count >= SETTLING_LOOK_COUNT
            and math.dist(entry.position[:2], position[:2]) <= max_distance
        ]
        for key in keys:
            self._close(key)
        return bool(keys)

    def _close(self, key: str) -> None:
        """Close the entry with a key, if there is one."""
        entry = self._entries.pop(key, None)
        if entry is not None:
            event = entry.event
            self._emit(UnexplainedChanged(event.name, event.text, event.position, is_open=False))

    def _show(self, entry: Entry, region: Region, frame: int) -> None:
        """Count a look that shows the region of an entry, and emit the entry."""
        position = round_values(region.position, 4)
        box = round_values(region.box, 1)
        text = region.text
        if entry.touch_height is not None:
            text += f"; the tool touched it at {entry.touch_height * 1000:.0f} mm"
        entry.look_count += 1
        entry.position = region.position
        entry.event = UnexplainedChanged(entry.event.name, text, position, frame, box)
        self._emit(entry.event)
