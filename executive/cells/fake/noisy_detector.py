"""Detector that adds errors to the answers of another detector, to test missions against errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from executive.cell.config import DetectorConfig, Section
from executive.cell.detection import Answer, Detection
from executive.cell.frame import Frame
from executive.cell.protocols import Detector
from executive.perception.detectors.requests import ChangedRequest
from executive.perception.detectors.setting import (
    DetectorSetting,
    OptionErrors,
    find_option_errors,
    read_options,
)

MAX_CONFUSED_CONFIDENCE = 0.75
"""Maximum confidence of a detection with a wrong class, 0 to 1."""
FALSE_BOX_SIDE_RANGE = (15.0, 40.0)
"""Minimum and maximum side of the box of a false detection [pixel]."""


class NoisyOptions(Section):
    """Options of a noisy detector in the cell file, in addition to its error rates."""

    of: str
    """Name of the detector of the cell to whose answers errors are added."""
    classes: tuple[str, ...]
    """Possible classes of detections with a wrong class and of false detections."""


class NoisyDetector:
    """Adds errors to the answers of another detector; implements `executive.cell.protocols.Detector`.

    The errors in each frame are random and depend on the seed. The detector omits the fraction `miss_rate`
    of the detections, gives the fraction `confusion_rate` a wrong class with low confidence, shifts each box
    along each axis by a normal deviate with standard deviation `jitter`, and adds `false_detections` boxes
    on average. The ledger assumes the same rates, because they come from the same section of the cell file.

    Attributes:
        is_fake: True: the error rates in the cell file are exact and need not be measured.
    """

    is_fake = True

    def __init__(self, config: DetectorConfig, options: NoisyOptions, setting: DetectorSetting) -> None:
        self._config = config
        self._options = options
        self._setting = setting
        self._other: Detector = setting.get_detector(options.of)

    @classmethod
    def from_config(cls, config: DetectorConfig, setting: DetectorSetting) -> NoisyDetector:
        """Return the noisy detector of a section of a cell file.

        Raises:
            InputError: An option is missing, unknown or wrong.
        """
        return cls(config, read_options(NoisyOptions, config), setting)

    @staticmethod
    def check(config: DetectorConfig, base: Path, others: Mapping[str, DetectorConfig]) -> OptionErrors:
        """Yield each invalid option, with a message."""
        del base
        invalid_options = list(find_option_errors(NoisyOptions, config))
        yield from invalid_options
        if not invalid_options and config.options["of"] not in others:
            yield "of", f'the cell has no detector "{config.options["of"]}"; it has: {", ".join(others)}'

    def request(self, frame: Frame, view: str) -> ChangedRequest:
        """Return the request to the other detector, with errors added to its answer."""
        request = self._other.request(frame, view)
        return ChangedRequest(request, lambda answer: self._add_errors(answer, frame, view))

    def close(self) -> None:
        """Do nothing: the detector holds no resources."""

    def _add_errors(self, answer: Answer, frame: Frame, view: str) -> Answer:
        """Return the answer with random errors, which depend on the seed, the frame and the view."""
        random = np.random.default_rng([self._setting.seed, frame.id, len(view)])
        kept = [detection for detection in answer.confident if random.random() >= self._config.miss_rate]
        found = [self._shift_box(self._replace_class(detection, random), random) for detection in kept]
        false_count = random.poisson(self._config.false_detections)
        found += [self._make_false_detection(frame, view, random) for _ in range(false_count)]
        found.sort(key=lambda detection: -detection.confidence)
        return Answer(self._setting.name, tuple(found), self._config.error_rates)

    def _replace_class(self, detection: Detection, random: np.random.Generator) -> Detection:
        if random.random() >= self._config.confusion_rate:
            return detection
        wrong_labels = [label for label in self._options.classes if label != detection.label]
        return replace(
            detection,
            label=str(random.choice(wrong_labels)),
            confidence=self._draw_confidence(MAX_CONFUSED_CONFIDENCE, random),
        )

    def _shift_box(self, detection: Detection, random: np.random.Generator) -> Detection:
        right, down = random.normal(0.0, self._config.jitter, 2)
        x0, y0, x1, y1 = detection.box
        return replace(detection, box=(x0 + right, y0 + down, x1 + right, y1 + down))

    def _make_false_detection(self, frame: Frame, view: str, random: np.random.Generator) -> Detection:
        height, width = frame.image.shape[:2]
        left, top, right, bottom = (
            self._setting.camera.table_view if view == "table" else (0, 0, width, height)
        )
        x, y = random.uniform((left, top), (right, bottom))
        half_width, half_height = random.uniform(*FALSE_BOX_SIDE_RANGE, 2) / 2
        box = (x - half_width, y - half_height, x + half_width, y + half_height)
        return Detection(str(random.choice(self._options.classes)), self._draw_confidence(1.0, random), box)

    def _draw_confidence(self, max_confidence: float, random: np.random.Generator) -> float:
        return float(random.uniform(self._config.floor, max_confidence))
