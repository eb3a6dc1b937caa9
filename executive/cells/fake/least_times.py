"""Minimum times in a fake cell."""

from __future__ import annotations

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.layout import as_bin, travel_height
from executive.cells.fake.arm import TOOL_SPEED
from executive.cells.fake.world import TOUCH_DISTANCE
from executive.cells.least_times import CellLeastTimes


class FakeTimes(CellLeastTimes):
    """The fake arm's straight paths at its one speed; implements `executive.cell.protocols.LeastTimes`."""

    def __init__(self, config: CellConfig) -> None:
        super().__init__(config, TOUCH_DISTANCE)

    def _carry(self, bin: str) -> float:
        """Straight up from the tallest object of the workspace, then across to the nearest slot [s]."""
        tallest = max(kind.height for kind in self._config.objects.values())
        slots = as_bin(bin, self._config.bins[bin]).slots
        low, high = np.array([self._config.table.x, self._config.table.y]).T
        across = float(np.linalg.norm(slots - np.clip(slots, low, high), axis=1).min())
        return (travel_height(self._config) - tallest + across) / TOOL_SPEED
