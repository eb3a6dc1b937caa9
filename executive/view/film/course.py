"""What a person sees of a recorded run at any of its control steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from executive.mission.outline import OutlineNode
from executive.record.entry import OldEvent
from executive.record.progress import skill_name
from executive.view.items import ItemTable, Row
from executive.view.tree.outline import skills

TOLD = 1.6
"""How long a failure is told [s] on the robot's clock."""


class Course:
    """Follows the journal of a run, as far as it is asked to.

    Args:
        entries: What counts of its journal, in order.
        nodes: The tree.
        pictures: The pictures behind the decisions, whose names begin with the control step.

    Attributes:
        status: Status of every node that was told of, by path.
        beside: What stands beside a node: the reason why it failed, or the item it is about; by path.
        picture: The last picture; None before the first.
        clock: Time on the robot's clock [s].
    """

    def __init__(
        self, entries: Sequence[Mapping[str, Any]], nodes: Sequence[OutlineNode], pictures: Sequence[Path]
    ) -> None:
        self.status: dict[str, str] = {}
        self.beside: dict[str, str] = {}
        self.picture: Path | None = None
        self._entries = list(entries)[::-1]
        self._pictures = sorted(pictures, reverse=True)
        self._skills = skills(nodes)
        self._items = ItemTable()
        self._bins: dict[str, str] = {}
        self._trouble: tuple[float, str] = (-TOLD, "")
        self.clock = 0.0
        self._ended: dict[str, tuple[int, str]] = {}
        self._last = (0, "")

    @property
    def items(self) -> tuple[Row, ...]:
        """Every item so far, in the order of first sight."""
        return self._items.rows

    @property
    def open(self) -> frozenset[str]:
        """Paths of the nodes that run; of a tree that ended, of those that ended with and as it did."""
        running = frozenset(path for path, status in self.status.items() if status == "RUNNING")
        return running or frozenset(path for path, ended in self._ended.items() if ended == self._last)

    @property
    def trouble(self) -> str:
        """What went wrong with an item or the run a moment ago, in a sentence; "" if nothing did."""
        when, sentence = self._trouble
        return sentence if self.clock < when + TOLD else ""

    @property
    def doing(self) -> str:
        """What the robot does: the first skill that runs, its item, where to if it is held; "" if none."""
        held = {row.item for row in self.items if row.state == "held"}
        for path, name in self._skills.items():
            if self.status.get(path) == "RUNNING":
                item = self.beside.get(path, "")
                bin = self._bins.get(item, "") if item in held else ""
                return " ".join(part for part in (name, item, f"to {bin}" if bin else "") if part)
        return ""

    def go_to(self, step: int, clock: float) -> None:
        """Take in what happened up to a control step, at which the robot's clock showed `clock` [s]."""
        self.clock = clock
        while self._entries and self._entries[-1]["tick"] <= step:
            self._take(self._entries.pop())
        while self._pictures and int(self._pictures[-1].stem.partition("_")[0]) <= step:
            self.picture = self._pictures.pop()

    def _take(self, entry: Mapping[str, Any]) -> None:
        kind = entry["kind"]
        if kind == "status":
            self._take_status(entry)
        elif kind == "item":
            self._items(OldEvent(kind, entry["tick"], entry["clock"], dict(entry)))
        elif kind == "decision":
            self._bins[entry["item"]] = entry["bin"]
        elif kind in ("halt", "fault"):
            self._trouble = (entry["clock"], f"{kind}: {entry.get('message', '')}".rstrip(": "))
        elif kind == "resume":
            self._trouble = (entry["clock"], "taken up again")

    def _take_status(self, entry: Mapping[str, Any]) -> None:
        path, status = entry["node"], entry["status"]
        if status == "RUNNING":
            # What its nodes came to in the round before says nothing of this one.
            for below in [known for known in self.status if known.startswith(f"{path}/")]:
                del self.status[below]
                self.beside.pop(below, None)
        self.status[path] = status
        self._ended[path] = self._last = (entry["tick"], status)
        self.beside[path] = entry.get("reason") or entry.get("item") or ""
        if status == "FAILURE" and entry.get("item"):
            name = f"{skill_name(path)}.{entry['reason']}"
            self._trouble = (entry["clock"], f"{name}: {entry['message']}")
