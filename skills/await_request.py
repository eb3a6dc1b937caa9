"""Skill that asks the operator for the next class."""

from __future__ import annotations

from executive.cell.protocols import Cell
from executive.skill import Out, Skill, port


class AwaitRequest(Skill):
    """Ask the operator which class to pick next; the clock of the run stops until the operator answers."""

    wanted: Out[str] = port(refers_to="class", doc="the requested class")
    reasons = ("rescan", "quit")
    senses = True

    def run(self, cell: Cell) -> None:
        """Ask the operator once, and wait for the answer."""
        answer = cell.operator.ask(tuple(cell.routes))
        if answer is None:
            raise self.failure("quit", "the operator ended the requests")
        if answer == "rescan":
            raise self.failure("rescan", "the operator requested a new look")
        self.wanted = answer
