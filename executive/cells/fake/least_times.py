"""Minimum times of the stages of a task in a fake cell."""

from __future__ import annotations

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.layout import as_bin, travel_height
from executive.cells.fake.arm import TOOL_SPEED
from executive.cells.fake.world import TOUCH_DISTANCE
from executive.cells.least_times import CellLeastTimes


class FakeTimes(CellLeastTimes):
    """Times of straight paths at the speed of the fake arm; implements `LeastTimes` of `executive.cell`."""

    def __init__(self, config: CellConfig) -> None:
        super().__init__(config, TOUCH_DISTANCE)

    def _min_carry_time(self, bin: str) -> float:
        """Return the time straight up from the tallest object, then across to the nearest slot [s]."""
        max_height = max(kind.height for kind in self._config.objects.values())
        slots = as_bin(bin, self._config.bins[bin]).slots
        low, high = np.array([self._config.table.x, self._config.table.y]).T
        distance = float(np.linalg.norm(slots - np.clip(slots, low, high), axis=1).min())
        return (travel_height(self._config) - max_height + distance) / TOOL_SPEED
