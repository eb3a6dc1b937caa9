"""Minimum times of descent, transport and detection that depend only on the cell file."""

from __future__ import annotations

import functools

from executive.cell.config import CellConfig


class CellMinTimes:
    """Base class of the minimum times of a cell, which implement `executive.cell.protocols.MinTimes`.

    Args:
        config: The cell file.
        touch_distance: Distance at which the tool detects a surface [m].
        max_excess_height: Maximum height of the top of an object above its expected height [m].
    """

    def __init__(self, config: CellConfig, touch_distance: float, max_excess_height: float = 0.0) -> None:
        self._config = config
        self._get_min_transport_time = functools.cache(self._compute_min_transport_time)
        self._max_descent_shortening = touch_distance + max_excess_height

    @property
    def descent_time(self) -> float:
        """Minimum time [s] of a guarded descent onto an object, which may be above its expected height."""
        motion = self._config.motion
        slow_descent = min(motion.descent, motion.slow_descent)
        return max(0.0, slow_descent - self._max_descent_shortening) / motion.descent_speed

    def get_transport_time(self, bin: str | None) -> float:
        """Return the minimum time [s] to transport an object to `bin`, or to the nearest bin if it is None.

        The time is 0 for a bin that the cell lacks or that the arm does not reach.
        """
        names = self._config.bins if bin is None else {bin} & set(self._config.bins)
        return min(map(self._get_min_transport_time, names), default=0.0)

    def get_answer_time(self, detector: str) -> float:
        """Return the latency of a detector [s], "" for the first one; 0 if the cell lacks the detector."""
        detectors = self._config.detectors
        config = detectors.get(detector or next(iter(detectors)))
        return config.latency if config else 0.0

    def _compute_min_transport_time(self, bin: str) -> float:
        """Return the minimum time to transport an object to a bin of the cell [s]."""
        raise NotImplementedError
