"""The course of a run as far as a story may need it, in memory that does not grow with its length."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

from executive.errors import RecordLost
from executive.record.diagnosis.items import ItemCourses
from executive.record.entry import OldEvent as Event
from executive.skill import Skill

_PLACE = re.compile(r'File "(?P<file>[^"]+)", line (?P<line>\d+), in (?P<function>\S+)')
_SKILL = "executive/skill.py"
_CAUSED = "\nThe above exception was the direct cause"
_WORTH_TELLING = (bool, int, float, str)


@dataclass(frozen=True)
class Sense:
    """What the cell answered: since when, and the name of the exception where its text is the answer."""

    name: str
    value: bool | int | float | str
    raised: str
    tick: int
    clock: float


@dataclass(eq=False)
class Activation:
    """One time that a node ran.

    Attributes:
        order: Of all activations of the run, the how manieth.
        began, ended: Time on the run's clock [s]; `ended` is meaningless while it runs.
        tick: Control step in which it ended.
        item: What a skill was about, or "".
        status: `RUNNING`, `SUCCESS`, `FAILURE` or `INVALID`.
        reason, message: Why it failed; the reason of a skill without the skill's name.
        choice: What a control node decided last.
        passed: How often it went on after a failure, by that failure.
        said: The last message of each of these.
        last: The last of them.
        cut: Paths of the skills that ran until this node ended them.
        senses: What the cell had answered when a skill failed, the latest last.
    """

    order: int
    began: float
    ended: float = 0.0
    tick: int = 0
    item: str = ""
    status: str = "RUNNING"
    reason: str = ""
    message: str = ""
    choice: str = ""
    passed: Counter[str] = field(default_factory=Counter)
    said: dict[str, str] = field(default_factory=dict)
    last: str = ""
    cut: tuple[str, ...] = ()
    senses: tuple[Sense, ...] = ()


class Course:
    """Follows a run; an observer.

    Of every node the last activation is remembered, of every sense the last answer, of every item that is in
    no bin what happened to it.

    Attributes:
        items: What happened to the items.
        asking: True while the operator is being asked something.
        raised_at: Where the exception behind a fault was raised, or "".
        unrecorded: True where that was that the record could not be kept.
    """

    def __init__(self) -> None:
        self.items = ItemCourses()
        self.asking = False
        self.raised_at = ""
        self.unrecorded = False
        self._root = ""
        self._count = 0
        self._nodes: dict[str, Activation] = {}
        self._senses: dict[str, Sense] = {}
        self._cut: list[str] = []

    def __call__(self, event: Event) -> None:
        """Take an event."""
        data = event.data
        if event.kind == "sense":
            self._sense(event)
        elif event.kind == "status":
            self._status(event)
        elif event.kind == "choice":
            self._choice(data)
        elif event.kind in ("asking", "request"):
            self.asking = event.kind == "asking"
        elif event.kind == "fault":
            self.raised_at = _place(str(data["traceback"]))
            self.unrecorded = f".{RecordLost.__name__}: " in data["traceback"]
        else:
            self.items(event)

    def node(self, path: str) -> Activation | None:
        """Return the last activation of a node, or None where it never ran."""
        return self._nodes.get(path)

    @property
    def cut(self) -> tuple[str, ...]:
        """Paths of the skills that ran until the run was over, or until something ended them all at once."""
        return tuple(self._cut)

    def _status(self, event: Event) -> None:
        data = event.data
        path, status = str(data["node"]), data["status"]
        self._root = self._root or path
        if status == "RUNNING":
            self._count += 1
            self._nodes[path] = Activation(self._count, event.clock)
        node = self._nodes.setdefault(path, Activation(self._count, event.clock))
        node.status, node.ended, node.tick = status, event.clock, event.tick
        node.reason, node.message = str(data.get("reason", "")), str(data.get("message", ""))
        node.item = str(data.get("item", "")) or node.item
        if status != "INVALID":
            node.cut, self._cut = tuple(self._cut), []
        elif "item" in data:
            self._cut.append(path)
        if "item" in data and node.reason:
            node.senses = tuple(self._senses.values())
        if "item" in data and status == "FAILURE":
            self.items.failed(event)
        if path == self._root and status != "RUNNING":
            self.items.close()

    def _choice(self, data: Mapping[str, Any]) -> None:
        node = self._nodes.get(str(data["node"]))
        if node is None:
            return
        node.choice = str(data["choice"])
        if reason := str(data.get("reason", "")):
            node.passed[reason] += 1
            node.said[reason] = str(data.get("message", ""))
            node.last = reason

    def _sense(self, event: Event) -> None:
        name, value = str(event.data["name"]), event.data.get("value")
        self._senses.pop(name, None)
        # Poses, images and lists are no answers that a sentence could hold.
        if isinstance(value, _WORTH_TELLING):
            raised = str(event.data.get("raised", ""))
            self._senses[name] = Sense(name, value, raised, event.tick, event.clock)


def _place(traceback: str) -> str:
    """Return where the exception was raised that everything began with: `skills/grasp.py:45, in run`."""
    cause, _, whole = traceback.rpartition(_CAUSED)
    places = [place.group("file", "line", "function") for place in _PLACE.finditer(cause or whole)]
    if len(places) > 1 and places[-1][0].endswith(_SKILL) and places[-1][2] == Skill.failed.__name__:
        places.pop()  # The skill's own line says more.
    if not places:
        return ""
    file, line, function = places[-1]
    return f"{'/'.join(PurePath(file).parts[-2:])}:{line}, in {function}"
