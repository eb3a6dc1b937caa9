"""The mean average precision, as supervision computes it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from executive.messages import Detection
from executive.vision.samples import LabelledImage


class AveragePrecision:
    """Gathers images and gives the mean average precision over all classes that are on them."""

    def __init__(self) -> None:
        # Half a second and 120 MB: only who evaluates pays for it.
        import supervision
        from supervision.metrics import MeanAveragePrecision

        self._detections = supervision.Detections
        self._metric = MeanAveragePrecision()
        self._numbers: dict[str, int] = {}
        self._objects = 0

    def add(self, found: Sequence[Detection], sample: LabelledImage) -> None:
        """Count the answer to one image, every box from the detector's floor on."""
        predicted = self._detections(
            xyxy=np.array([one.box for one in found], dtype=float).reshape(-1, 4),
            confidence=np.array([one.confidence for one in found], dtype=float),
            class_id=self._classes([one.label for one in found]),
        )
        true = self._detections(
            xyxy=np.array(sample.boxes, dtype=float).reshape(-1, 4), class_id=self._classes(sample.labels)
        )
        self._metric.update([predicted], [true])
        self._objects += len(sample.labels)

    def result(self) -> tuple[float, float]:
        """Return it at an overlap of 0.5, and averaged over 0.5 to 0.95; zeros where there was no object."""
        if not self._objects:
            return 0.0, 0.0
        result = self._metric.compute()
        return float(result.map50), float(result.map50_95)

    def _classes(self, labels: Sequence[str]) -> np.ndarray[tuple[int], np.dtype[np.int_]]:
        return np.array([self._numbers.setdefault(label, len(self._numbers)) for label in labels], dtype=int)
