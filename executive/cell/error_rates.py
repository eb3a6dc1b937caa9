"""Error rates of a detector, with which the ledger weights the detections."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ErrorRates:
    """Error rates of a detector in its cell, measured by `executive evaluate` or assumed.

    Attributes:
        threshold: Minimum confidence of a detection that is not doubtful, 0 to 1.
        miss_rate: Fraction of the completely visible objects that the search of a frame misses.
        confusion_rate: Fraction of the found objects that get a wrong class.
        false_detections: Mean number of false detections per frame.
        jitter: Standard deviation of the random error of the centre of a box, along each axis [pixel].
        repeated: Fraction of the errors that are repeated in a second frame from the same camera pose.
        bias: Standard deviation of the systematic error of a position, along each axis [m].
        assumption_reason: Reason why the rates are assumed; "" if they are measured.
    """

    threshold: float
    miss_rate: float
    confusion_rate: float
    false_detections: float
    jitter: float
    repeated: float = 0.0
    bias: float = 0.0
    assumption_reason: str = ""


def assume_rates(threshold: float, reason: str) -> ErrorRates:
    """Return conservative error rates for a detector without a measurement under the current conditions.

    In a measurement in unusual scenes, the embedded detector missed 4 % and confused 5 % of the objects, and
    repeated most errors in each frame. The assumed rates are equal or higher.
    """
    return ErrorRates(
        threshold, miss_rate=0.15, confusion_rate=0.05, false_detections=0.2, jitter=2.0, repeated=0.8,
        bias=0.002, assumption_reason=reason,
    )  # fmt: skip
