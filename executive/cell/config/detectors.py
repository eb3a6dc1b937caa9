"""Sections of a cell file: detectors with kind, thresholds and declared error rates."""

from __future__ import annotations

from typing import Any

from pydantic import ConfigDict, Field, model_validator

from executive.cell.config.section import Seconds, Section
from executive.cell.error_rates import ErrorRates


class DetectorConfig(Section):
    """A detector, its thresholds, its declared error rates, and the options of its kind."""

    model_config = ConfigDict(extra="allow", frozen=True, use_attribute_docstrings=True)

    kind: str
    """Kind of detector: the name of an entry point of the group `executive.detectors`."""
    threshold: float = Field(0.5, gt=0, lt=1)
    """Confidence below which a detection is doubtful, 0 to 1."""
    floor: float = Field(0.25, gt=0, lt=1)
    """Minimum confidence of a detection; detections with a lower confidence are discarded."""
    latency: Seconds = 0.05
    """Time from the frame to the answer, on the clock of the run [s]."""
    miss_rate: float = Field(0.03, gt=0, lt=1)
    """Fraction of the completely visible objects that a fake detector misses in a frame. For other kinds of
    detectors, measurements replace `miss_rate`, `confusion_rate`, `false_detections` and `jitter`."""
    confusion_rate: float = Field(0.004, gt=0, lt=1)
    """Fraction of the detected objects that get a wrong class."""
    false_detections: float = Field(0.02, gt=0, le=100)
    """Mean number of false detections (false positives) per frame."""
    jitter: float = Field(1.0, gt=0, le=1000)
    """Standard deviation of the random error of a box's centre, along each axis of the image [pixel]."""

    @model_validator(mode="after")
    def _check_floor(self) -> DetectorConfig:
        if self.floor > self.threshold:
            raise ValueError(
                f"needs a floor of at most its threshold, {self.threshold:g}, not {self.floor:g}"
            )
        return self

    @property
    def error_rates(self) -> ErrorRates:
        """Error rates that the cell file declares."""
        return ErrorRates(
            self.threshold, self.miss_rate, self.confusion_rate, self.false_detections, self.jitter
        )

    @property
    def options(self) -> dict[str, Any]:
        """Options of this kind of detector: all keys that are not fields of this class."""
        return dict(self.model_extra or {})
