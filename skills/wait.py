"""Skills that wait: for a fixed duration, or for a request of the operator."""

from __future__ import annotations

from executive.cell.protocols import Cell, Steps
from executive.skill import Out, Seconds, Skill, param, port


class Wait(Skill):
    """Wait until `seconds` have passed on the clock of the run."""

    seconds: Seconds = param(ge=0, le=3600, doc="duration")
    waits = "seconds"

    def run(self, cell: Cell) -> Steps:
        """Wait on the clock of the run."""
        yield from cell.clock.sleep(self.seconds)


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
