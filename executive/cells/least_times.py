"""Minimum times of the stages of a task, for all kinds of cells."""

from __future__ import annotations

from executive.cell.config import CellConfig


class CellLeastTimes:
    """Minimum times that follow from a cell file; base of `executive.cell.protocols.LeastTimes`.

    Args:
        config: The cell file.
        touch_distance: Distance at which the tool detects a surface [m].
        max_excess_height: Largest excess of the height of an object over the expected height [m].
    """

    def __init__(self, config: CellConfig, touch_distance: float, max_excess_height: float = 0.0) -> None:
        self._config = config
        self._max_saved_distance = touch_distance + max_excess_height

    @property
    def descent(self) -> float:
        """Minimum time of a guarded descent that expects the lowest and meets the highest object [s]."""
        motion = self._config.motion
        return max(0.0, motion.descent - self._max_saved_distance) / motion.descent_speed

    def carry(self, bin: str | None) -> float:
        """Return the minimum time from the objects to a position over a bin, None for the nearest bin [s].

        The time is 0 for a bin that the cell does not have or the arm does not reach.
        """
        names = self._config.bins if bin is None else {bin} & set(self._config.bins)
        return min(map(self._min_carry_time, names), default=0.0)

    def answer(self, detector: str) -> float:
        """Return the latency of a detector, "" for the first detector [s]; 0 if the cell lacks it."""
        detectors = self._config.detectors
        config = detectors.get(detector or next(iter(detectors)))
        return config.latency if config else 0.0

    def _min_carry_time(self, bin: str) -> float:
        raise NotImplementedError
