"""Detectors: kinds, thresholds and declared error rates."""

from __future__ import annotations

from typing import Any

from pydantic import ConfigDict, Field, model_validator

from executive.cell.config.section import Seconds, Section
from executive.cell.error_rates import ErrorRates


class DetectorConfig(Section):
    """A detector, its thresholds, its declared error rates, and the options of its kind."""

    model_config = ConfigDict(extra="allow", frozen=True, use_attribute_docstrings=True)

    kind: str
    """Name of an installed detector (entry-point group `executive.detectors`)."""
    threshold: float = Field(0.5, gt=0, lt=1)
    """Confidence from which a detection counts."""
    floor: float = Field(0.25, gt=0, lt=1)
    """Confidence below which a box is ignored."""
    latency: Seconds = 0.05
    """Time from a frame to the answer on the clock of the run [s]."""
    miss_rate: float = Field(0.03, gt=0, lt=1)
    """Share of the objects in full view that one look misses. This and the next three keys are only for fake
    detectors; `executive evaluate` measures the error rates of others."""
    confusion_rate: float = Field(0.004, gt=0, lt=1)
    """Share of the found objects that get a wrong class."""
    false_detections: float = Field(0.02, gt=0, le=100)
    """Number of false detections per look."""
    jitter: float = Field(1.0, gt=0, le=1000)
    """Standard deviation of the random error of a box's centre, along each axis [pixel]."""

    @model_validator(mode="after")
    def _check_floor(self) -> DetectorConfig:
        if self.floor > self.threshold:
            raise ValueError(f"needs a floor up to its threshold, {self.threshold:g}, not {self.floor:g}")
        return self

    @property
    def error_rates(self) -> ErrorRates:
        """Error rates that the cell file declares."""
        return ErrorRates(
            self.threshold, self.miss_rate, self.confusion_rate, self.false_detections, self.jitter
        )

    @property
    def options(self) -> dict[str, Any]:
        """Keys that only this kind of detector has."""
        return dict(self.model_extra or {})
