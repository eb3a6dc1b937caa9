"""The run's clock in simulation: it advances by physics steps and by nothing else."""

from __future__ import annotations

from executive.cell import Steps
from executive.sim.world import World


class SimClock:
    """Counts the world's physics steps; implements `executive.cell.Clock`."""

    def __init__(self, world: World, step: float) -> None:
        self._world = world
        self._step = step
        self._start = world.steps

    @property
    def steps(self) -> int:
        """Physics steps since the run began."""
        return self._world.steps - self._start

    @property
    def now(self) -> float:
        """Time since the run began [s]."""
        return self.steps * self._step

    @property
    def step(self) -> float:
        """Length of one control step [s]."""
        return self._step

    def skip(self, steps: int) -> None:
        """Leave out physics steps that were none of the run."""
        self._start += steps

    def sleep(self, duration: float) -> Steps:
        """Yield until `duration` [s] has passed on this clock."""
        end = self.now + duration
        while self.now < end - self._step / 2:
            yield
