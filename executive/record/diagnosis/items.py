"""Histories of the items that are in no bin."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from executive.record.entry import OldEvent as Event
from executive.record.progress import skill_name

Look = dict[str, Any]
"""How an item was seen: `frame`, `camera`, `detector`, `clock`, `label`, `confidence`, `position`, `looks`.

`looks` counts them, `label`, `confidence` and `position` [m] are those of the box.
"""

_DONE = ("placed", "phantom")
_OPEN = ("seen", "dropped", "held")


@dataclass(eq=False)
class ItemCourse:
    """What happened to one item.

    Attributes:
        row: What the ledger said of it last.
        state: What had become of it when the tree ended.
        look: How it was seen last, or None.
        unseen: Looks since then.
        held, dropped: When the tool got and lost it last [s], or None.
        failed: The last failure that was about it: what, why and when [s].
    """

    row: Mapping[str, Any] = field(default_factory=dict)
    state: str = ""
    look: Look | None = None
    unseen: int = 0
    held: float | None = None
    dropped: float | None = None
    failed: tuple[str, str, float] | None = None


class ItemCourses:
    """Follows the `item` and `look` events of a run; forgets what lies in a bin, and what never was.

    Attributes:
        items: What happened to each item, by name.
        last_look: The last look, whatever it showed: as `Look`, with the number of boxes as `found`; or None.
    """

    def __init__(self) -> None:
        self.last_look: Look | None = None
        self.items: dict[str, ItemCourse] = {}
        self._seen_now: list[str] = []
        self._closed = False

    def __call__(self, event: Event) -> None:
        """Take an event."""
        if event.kind == "item":
            self._item(event)
        elif event.kind == "look":
            self._look(event)

    def failed(self, event: Event) -> None:
        """Take the `status` event of a skill that failed."""
        data = event.data
        if (item := self.items.get(str(data["item"]))) is not None:
            what = f"{skill_name(str(data['node']))}.{data['reason']}"
            item.failed = what, str(data["message"]), event.clock

    def close(self) -> None:
        """Note that the tree has ended: what is said of items from now on is the closing of the books."""
        self._closed = True

    def lost(self) -> dict[str, ItemCourse]:
        """Return the items that the ledger calls lost, by name."""
        return {name: item for name, item in self.items.items() if item.row.get("state") == "lost"}

    def open(self, labels: Mapping[str, Any]) -> list[str]:
        """Return the items of these classes that had not been dealt with when the tree ended."""
        left = {name: item for name, item in self.items.items() if item.state in _OPEN}
        return [name for name, item in left.items() if item.row.get("label") in labels]

    def held(self) -> list[str]:
        """Return the items that were believed in the tool when the tree ended."""
        return [name for name, item in self.items.items() if item.state == "held"]

    def _item(self, event: Event) -> None:
        row = event.data
        name, state = str(row["item"]), str(row.get("state", ""))
        if state in _DONE:
            self.items.pop(name, None)
            return
        item = self.items.setdefault(name, ItemCourse())
        if row.get("looks", 0) > item.row.get("looks", 0):
            self._seen_now.append(name)
        if state == "held" and item.state != "held":
            item.held = event.clock
        elif state == "dropped" and item.state != "dropped":
            item.dropped = event.clock
        item.row = dict(row)
        if not self._closed:
            item.state = state

    def _look(self, event: Event) -> None:
        """Remember the look, also as the last of each item that was seen in it."""
        data = event.data
        look = {key: data.get(key, "") for key in ("frame", "camera", "detector")} | {"clock": event.clock}
        found = data.get("found", ())
        self.last_look = {**look, "found": len(found)}
        for item in self.items.values():
            item.unseen += 1
        for name in self._seen_now:
            if (seen := self.items.get(name)) is not None:
                box = _nearest(found, seen.row.get("position"))
                shown = {key: box.get(key) for key in ("label", "confidence", "position")}
                seen.look, seen.unseen = {**look, **shown, "looks": seen.row.get("looks", 0)}, 0
        self._seen_now = []


def _nearest(found: Sequence[Mapping[str, Any]], place: Sequence[float] | None) -> Mapping[str, Any]:
    located = [box for box in found if box.get("position") is not None]
    if place is None or not located:
        return {}
    return min(located, key=lambda box: math.dist(box["position"], place))
