"""Detector that adds random errors to the answers of another detector."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from executive.cell.config import DetectorConfig
from executive.cell.frame import Detection, Frame
from executive.perception.detectors.detector_registry import DetectorContext, DetectorOptions, OptionErrors

MAX_CONFUSED_CONFIDENCE = 0.75
"""Maximum confidence of a detection with a wrong class, 0 to 1."""
FALSE_BOX_SIDE_RANGE = (15.0, 40.0)
"""Minimum and maximum side of the box of a false detection [pixel]."""


class NoisyOptions(DetectorOptions):
    """Options of a noisy detector in the cell file, in addition to its error rates."""

    of: str
    """Name of the base detector, to whose detections errors are added."""
    classes: tuple[str, ...]
    """Classes that wrong and false detections can have."""


class NoisyDetector:
    """Detector that adds random errors to the detections of another detector.

    The errors in each frame are random and depend on the seed. The detector omits the fraction `miss_rate`
    of the detections, gives the fraction `confusion_rate` a wrong class with low confidence, shifts each box
    along each axis by a normal deviate with standard deviation `jitter`, and adds `false_detections` boxes
    on average. The ledger computes with these error rates, which are exact.

    Attributes:
        is_fake: True: the error rates in the cell file are exact and need not be measured.
    """

    is_fake = True

    def __init__(self, config: DetectorConfig, context: DetectorContext) -> None:
        self._config = config
        self._options = NoisyOptions.read(config)
        self._context = context
        self._base_detector = context.get_detector(self._options.of)

    @classmethod
    def from_config(cls, config: DetectorConfig, context: DetectorContext) -> NoisyDetector:
        """Return the detector of a section of a cell file; raise InputError for a wrong option."""
        return cls(config, context)

    @staticmethod
    def check(config: DetectorConfig, base: Path, all_configs: Mapping[str, DetectorConfig]) -> OptionErrors:
        """Yield each invalid option, with a message."""
        del base
        invalid_options = list(NoisyOptions.find_errors(config))
        yield from invalid_options
        if not invalid_options and config.options["of"] not in all_configs:
            yield "of", f'the cell has no detector "{config.options["of"]}"; it has: {", ".join(all_configs)}'

    def detect(self, frame: Frame, view: str) -> list[Detection]:
        """Return the detections of the base detector with errors, which depend on seed, frame and view."""
        base_detections = self._base_detector.detect(frame, view)
        # The length of the name identifies the view, because the names of all views differ in length.
        rng = np.random.default_rng([self._context.seed, frame.id, len(view)])
        detections = [detection for detection in base_detections if rng.random() >= self._config.miss_rate]
        detections = [self._shift_box(self._replace_class(detection, rng), rng) for detection in detections]
        false_count = rng.poisson(self._config.false_detections)
        detections += [self._make_false_detection(view, rng) for _ in range(false_count)]
        return sorted(detections, key=lambda detection: -detection.confidence)

    def _replace_class(self, detection: Detection, rng: np.random.Generator) -> Detection:
        """Return the detection with a wrong class at the confusion rate, else unchanged."""
        if rng.random() >= self._config.confusion_rate:
            return detection
        wrong_labels = [label for label in self._options.classes if label != detection.label]
        label = str(rng.choice(wrong_labels))
        return replace(detection, label=label, confidence=self._draw_confidence(MAX_CONFUSED_CONFIDENCE, rng))

    def _shift_box(self, detection: Detection, rng: np.random.Generator) -> Detection:
        x, y = rng.normal(0.0, self._config.jitter, 2).tolist()
        return detection.shift(x, y)

    def _make_false_detection(self, view: str, rng: np.random.Generator) -> Detection:
        """Return a detection with random class, confidence and box in the region of a view."""
        region = self._context.camera.get_view_box(view)
        x, y = rng.uniform(region[:2], region[2:])
        half_width, half_height = rng.uniform(*FALSE_BOX_SIDE_RANGE, 2) / 2
        box = (x - half_width, y - half_height, x + half_width, y + half_height)
        return Detection(str(rng.choice(self._options.classes)), self._draw_confidence(1.0, rng), box)

    def _draw_confidence(self, max_confidence: float, rng: np.random.Generator) -> float:
        """Return a random confidence from `floor` of the cell file to `max_confidence`."""
        return float(rng.uniform(self._config.floor, max_confidence))
