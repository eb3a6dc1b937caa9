"""Observer of a skill's calls of its cell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from executive.cell.protocols import Cell
from executive.cell.proxy import Access, intercept

_ROLES = ("arm", "tool", "camera", "detector", "ledger", "localizer", "operator")


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
    """Observes every call of a method of the parts of a cell.

    Args:
        cell: The cell.

    Attributes:
        cell: The cell that the skill is to see instead.
        calls: Every call of a method, in order.
        tick: The control step of the calls to come.
    """

    def __init__(self, cell: Cell) -> None:
        self.calls: list[Call] = []
        self.tick = 0
        self.cell = intercept(cell, self._answer, _ROLES)

    def _answer(self, access: Access) -> Any:
        if access.is_call and access.role in _ROLES:
            self.calls.append(Call(self.tick, access.name, access.all_arguments))
        return access.proceed()
