"""Mean average precision, as supervision computes it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from executive.cell.detection import Detection
from executive.cell.frame import Box
from executive.training.labelled_image import LabelledImage


class AveragePrecision:
    """Gathers images and gives the mean average precision over all classes that are on them."""

    def __init__(self) -> None:
        # Half a second and 120 MB: only an evaluation pays for it.
        import supervision
        from supervision.metrics import MeanAveragePrecision

        self._kind = supervision.Detections
        self._metric = MeanAveragePrecision()
        self._numbers: dict[str, int] = {}
        self._has_objects = False

    def add(self, found: Sequence[Detection], sample: LabelledImage) -> None:
        """Count the answer to one image, every box from the detector's floor on."""
        predicted = self._detections([one.box for one in found], [one.label for one in found])
        predicted.confidence = np.array([one.confidence for one in found], dtype=float)
        self._metric.update([predicted], [self._detections(sample.boxes, sample.labels)])
        self._has_objects |= bool(sample.labels)

    def result(self) -> tuple[float, float]:
        """Return it at an overlap of 0.5, and averaged over 0.5 to 0.95; zeros where there was no object."""
        if not self._has_objects:
            return 0.0, 0.0
        result = self._metric.compute()
        return float(result.map50), float(result.map50_95)

    def _detections(self, boxes: Sequence[Box], labels: Sequence[str]) -> Any:
        numbers = [self._numbers.setdefault(label, len(self._numbers)) for label in labels]
        return self._kind(np.array(boxes, float).reshape(-1, 4), class_id=np.array(numbers, dtype=int))
