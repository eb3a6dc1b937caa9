"""Clock of a simulated run: it advances by physics steps and by nothing else."""

from __future__ import annotations

from executive.cell.clock import StepClock
from executive.cells.sim.world import World


class SimClock(StepClock):
    """Clock that counts the world's physics steps; implements `executive.cell.protocols.Clock`."""

    def __init__(self, world: World, step: float) -> None:
        super().__init__(lambda: self.steps * step, step)
        self._world = world
        self._start = world.steps

    @property
    def steps(self) -> int:
        """Physics steps since the run began."""
        return self._world.steps - self._start

    def skip(self, steps: int) -> None:
        """Leave out physics steps that were none of the run."""
        self._start += steps
