"""How far a run is: what the robot is doing and what became of every item, from the events so far."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

from executive.events import Event

_OPEN_FATES = ("held", "dropped", "rejected", "skipped", "lost")
"""States of items outside of bins that are reported; items on the table are not."""


class Progress:
    """Follows the events of a run."""

    def __init__(self) -> None:
        self.mission = ""
        self._running: dict[str, str] = {}
        self._items: dict[str, Mapping[str, Any]] = {}
        self._classes: dict[str, None] = {}

    def __call__(self, event: Event) -> None:
        """Take an event."""
        data = event.data
        if event.kind == "status" and is_skill(data):
            if data["status"] == "RUNNING":
                self._running[data["node"]] = skill_name(data["node"])
            else:
                self._running.pop(data["node"], None)
        elif event.kind == "item":
            if data.get("state") != self.item(data["item"]).get("state"):
                # What happened to it is news: it goes to the end of its list.
                self._items.pop(data["item"], None)
            self._items[data["item"]] = data
        elif event.kind == "look":
            # Classes of one look come in alphabetical order, so that most runs agree on the order.
            self._classes |= dict.fromkeys(sorted(found["label"] for found in data.get("found", ())))
        elif event.kind == "run":
            self.mission = str(data.get("mission", ""))

    @property
    def phase(self) -> str:
        """The skills that run, those at the same time joined by `+`; "" before the first."""
        return " + ".join(self._running.values())

    @property
    def classes(self) -> Sequence[str]:
        """Every class seen so far; a class keeps its place."""
        return tuple(self._classes)

    def item(self, name: str) -> Mapping[str, Any]:
        """Return what the ledger last said of an item; empty for an unknown one."""
        return self._items.get(name, {})

    def fates(self) -> dict[str, tuple[str, ...]]:
        """Return the items by bin, then the others by what became of them."""
        placed: dict[str, list[str]] = defaultdict(list)
        others: dict[str, list[str]] = defaultdict(list)
        for name, item in self._items.items():
            state = item.get("state")
            if state == "placed":
                placed[item["bin"]].append(name)
            elif state in _OPEN_FATES:
                others["in the tool" if state == "held" else state].append(name)
        return {fate: tuple(names) for fate, names in (placed | others).items()}


def is_skill(status: Mapping[str, Any]) -> bool:
    """Tell whether a `status` event is a skill's: only those say which item they are about."""
    return "item" in status


def skill_name(path: str) -> str:
    """Return the skill at the end of a node's path, or what the mission calls it."""
    return path.rpartition("/")[2].rpartition(":")[2]
