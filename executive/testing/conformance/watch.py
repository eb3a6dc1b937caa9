"""The cell as a skill sees it under watch: every call is noted, and may be answered otherwise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from executive.cell import Cell


@dataclass(frozen=True)
class Call:
    """A call of a part of the cell.

    Attributes:
        tick: Control step in which it was made.
        name: Part and method, for instance `arm.start`.
        arguments: As given.
    """

    tick: int
    name: str
    arguments: tuple[Any, ...]


class Watch:
    """Stands between a skill and the parts of its cell.

    Args:
        cell: What is watched.

    Attributes:
        cell: What the skill is to see instead.
        calls: Every call of a method, in order.
        tick: The control step of the calls to come.
        instead: What answers a call, by its name, in place of the part.
    """

    def __init__(self, cell: Cell) -> None:
        self.calls: list[Call] = []
        self.tick = 0
        self.instead: dict[str, Callable[..., Any]] = {}
        watched: dict[str, Any] = {
            part: _Watched(part, getattr(cell, part), self)
            for part in ("arm", "tool", "camera", "ledger", "localizer", "operator")
        }
        detectors = {name: _Watched("detector", one, self) for name, one in cell.detectors.items()}
        self.cell = replace(cell, detectors=detectors, **watched)

    def answer(self, name: str, part: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
        """Note a call and return what `part`, or whoever stands in for it, says."""
        self.calls.append(Call(self.tick, name, (*arguments, *named.values())))
        return self.instead.get(name, part)(*arguments, **named)


class _Watched:
    """A part of a cell whose methods are called through a watch; what it says of itself is read as ever."""

    def __init__(self, name: str, part: Any, watch: Watch) -> None:
        self._name, self._part, self._watch = name, part, watch

    def __getattr__(self, attribute: str) -> Any:
        value = getattr(self._part, attribute)
        if not callable(value):
            return value

        def call(*arguments: Any, **named: Any) -> Any:
            return self._watch.answer(f"{self._name}.{attribute}", value, *arguments, **named)

        return call
