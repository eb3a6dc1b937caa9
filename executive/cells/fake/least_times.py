"""What things take in a fake cell at the very least."""

from __future__ import annotations

import numpy as np

from executive.cell.bins import Bin
from executive.cell.config import CellConfig
from executive.cell.layout import as_bin, travel_height
from executive.cells.fake.arm import SPEED
from executive.cells.fake.world import TOUCH


class FakeTimes:
    """The fake arm's straight ways at its one speed; implements `executive.cell.protocols.LeastTimes`."""

    def __init__(self, config: CellConfig) -> None:
        self._config = config

    @property
    def descent(self) -> float:
        """The guarded last part of an approach [s]; the cup feels the object a little above it."""
        motion = self._config.motion
        return max(0.0, motion.descent - TOUCH) / motion.descent_speed

    def carry(self, bin: str | None) -> float:
        """Straight up from the tallest object of the workspace, then across to the nearest slot [s]."""
        tallest = max(kind.height for kind in self._config.objects.values())
        names = self._config.bins if bin is None else [bin]
        bins = [as_bin(name, self._config.bins[name]) for name in names if name in self._config.bins]
        lift = travel_height(self._config) - tallest
        return min(((lift + self._across(bin)) / SPEED for bin in bins), default=0.0)

    def answer(self, detector: str) -> float:
        """Return the latency of a detector of the cell file [s]."""
        detectors = self._config.detectors
        name = detector or next(iter(detectors))
        return detectors[name].latency if name in detectors else 0.0

    def _across(self, bin: Bin) -> float:
        """Return the distance [m] between the workspace and the nearest slot of a bin."""
        low, high = np.array([self._config.table.x, self._config.table.y]).T
        return float(np.linalg.norm(bin.slots - np.clip(bin.slots, low, high), axis=1).min())
