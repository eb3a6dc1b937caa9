"""How far a run is: what the robot is doing and what became of every item, from the events so far."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from executive.events import FrameSearched, ItemChanged, NodeEnded, NodeStarted, RunStarted, TimedEvent

_OPEN_FATES = ("held", "dropped", "rejected", "skipped", "lost")
"""States of items outside of bins that are reported; items on the table are not."""


class Progress:
    """Follows the events of a run."""

    def __init__(self) -> None:
        self.mission = ""
        self._running: dict[str, str] = {}
        self._items: dict[str, ItemChanged] = {}
        self._classes: dict[str, None] = {}

    def __call__(self, timed: TimedEvent) -> None:
        """Take an event."""
        event = timed.event
        match event:
            case NodeStarted(node, skill) if skill:
                self._running[node] = skill_name(node)
            case NodeEnded(node):
                self._running.pop(node, None)
            case ItemChanged(item):
                known = self._items.get(item)
                if known is None or known.state != event.state:
                    # What happened to it is news: it goes to the end of its list.
                    self._items.pop(item, None)
                self._items[item] = event
            case FrameSearched(found=found):
                # Classes of one look come in alphabetical order, so that most runs agree on the order.
                self._classes |= dict.fromkeys(sorted(one.label for one in found))
            case RunStarted(mission):
                self.mission = mission

    @property
    def phase(self) -> str:
        """The skills that run, those at the same time joined by `+`; "" before the first."""
        return " + ".join(self._running.values())

    @property
    def classes(self) -> Sequence[str]:
        """Every class seen so far; a class keeps its place."""
        return tuple(self._classes)

    def item(self, name: str) -> ItemChanged | None:
        """Return the last state of an item, or None for an unknown item."""
        return self._items.get(name)

    def fates(self) -> dict[str, tuple[str, ...]]:
        """Return the items by bin, then the others by what became of them."""
        placed: dict[str, list[str]] = defaultdict(list)
        others: dict[str, list[str]] = defaultdict(list)
        for name, item in self._items.items():
            if item.state == "placed":
                placed[item.bin].append(name)
            elif item.state in _OPEN_FATES:
                others["in the tool" if item.state == "held" else item.state].append(name)
        return {fate: tuple(names) for fate, names in (placed | others).items()}


def skill_name(path: str) -> str:
    """Return the skill at the end of a node's path, or what the mission calls it."""
    return path.rpartition("/")[2].rpartition(":")[2]
