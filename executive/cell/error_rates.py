"""Error rates of a detector, with which the ledger weights the detections."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ErrorRates:
    """Error rates of a detector in its cell, measured by `executive evaluate` or assumed.

    Attributes:
        threshold: Confidence below which a detection is doubtful, 0 to 1.
        miss_rate: Fraction of the completely visible objects that the detector misses in a frame.
        confusion_rate: Fraction of the detected objects that get a wrong class.
        false_detections: Mean number of false detections (false positives) per frame.
        jitter: Standard deviation of the random error of a box's centre along each axis of the image [pixel].
        repeated: Fraction of the errors that occur again in a second frame from the same camera pose.
        bias: Standard deviation of the systematic error of an object's position, along each axis [m].
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

    In unusual scenes, the embedded detector missed 4 % of the objects, confused 5 % of the objects, and
    repeated most errors in each frame of a scene. Each assumed rate is at least as high.
    """
    return ErrorRates(
        threshold, miss_rate=0.15, confusion_rate=0.05, false_detections=0.2, jitter=2.0, repeated=0.8,
        bias=0.002, assumption_reason=reason,
    )  # fmt: skip
