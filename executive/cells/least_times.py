"""Minimum times that the kinds of cells share."""

from __future__ import annotations

from executive.cell.config import CellConfig


class CellLeastTimes:
    """Minimum times that follow from a cell file; base of `executive.cell.protocols.LeastTimes`.

    Args:
        config: The cell file.
        feeling_distance: Distance at which the tool already feels a surface [m].
        surplus: Largest height by which an object may be higher than expected [m].
    """

    def __init__(self, config: CellConfig, feeling_distance: float, surplus: float = 0.0) -> None:
        self._config = config
        self._saved = feeling_distance + surplus

    @property
    def descent(self) -> float:
        """The guarded last part of an approach, to the highest object where the lowest was expected [s]."""
        motion = self._config.motion
        return max(0.0, motion.descent - self._saved) / motion.descent_speed

    def carry(self, bin: str | None) -> float:
        """From the nearest place where objects lie to over a bin, or over the nearest bin [s].

        0 for a bin that the cell does not have, and if the arm does not reach one of the two.
        """
        names = self._config.bins if bin is None else {bin} & set(self._config.bins)
        return min(map(self._carry, names), default=0.0)

    def answer(self, detector: str) -> float:
        """From a frame to the answer of a detector; "": the first [s]. 0 for one that the cell lacks."""
        detectors = self._config.detectors
        config = detectors.get(detector or next(iter(detectors)))
        return config.latency if config else 0.0

    def _carry(self, bin: str) -> float:
        raise NotImplementedError
