"""Minimum times of descent, transport and detection in a fake cell, from the speed of the fake arm."""

from __future__ import annotations

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.layout import build_bin, compute_travel_height
from executive.cells.fake.arm import MAX_TOOL_SPEED
from executive.cells.fake.world import TOUCH_DISTANCE
from executive.cells.min_times import CellMinTimes


class FakeMinTimes(CellMinTimes):
    """Durations of straight paths at the maximum speed of the fake arm; implements `MinTimes`."""

    def __init__(self, config: CellConfig) -> None:
        super().__init__(config, TOUCH_DISTANCE)

    def _compute_min_transport_time(self, bin: str) -> float:
        """Return the time [s] to lift the tallest object to travel height and to move to the nearest slot."""
        max_height = max(object_class.height for object_class in self._config.objects.values())
        slots = build_bin(bin, self._config.bins[bin]).slots
        low, high = np.array([self._config.table.x, self._config.table.y]).T
        distance = float(np.linalg.norm(slots - np.clip(slots, low, high), axis=1).min())
        return (compute_travel_height(self._config) - max_height + distance) / MAX_TOOL_SPEED
