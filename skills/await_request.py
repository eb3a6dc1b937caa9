"""Ask the operator which class to pick."""

from __future__ import annotations

from typing import ClassVar

from executive.cell.protocols import Cell
from executive.skill import Out, Skill, port


class AwaitRequest(Skill):
    """Know which class the operator wants next; the run's clock stands still until they say it."""

    wanted: Out[str] = port(refers="class", doc="the class asked for")
    reasons: ClassVar = ("rescan", "quit")
    senses: ClassVar = True

    def run(self, cell: Cell) -> None:
        """Ask once."""
        answer = cell.operator.ask(tuple(cell.routes))
        if answer is None:
            raise self.failed("quit", "the operator asked for nothing more")
        if answer == "rescan":
            raise self.failed("rescan", "the operator asked for a fresh look")
        self.wanted = answer
