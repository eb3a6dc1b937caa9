"""A detector that errs on purpose: what a mission does about errors is tried out with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from executive.cell.config import DetectorConfig, Section
from executive.cell.detection import Answer, Detection
from executive.cell.frame import Frame
from executive.cell.protocols import Detector
from executive.perception.detectors.options import OptionFaults, find_wrong_options, read_options
from executive.perception.detectors.requests import ChangedRequest
from executive.perception.detectors.setting import DetectorSetting

MAX_CONFUSED_CONFIDENCE = 0.75
"""Highest confidence of a detection that is given a wrong class."""
INVENTED_SIDE_RANGE = (15.0, 40.0)
"""Shortest and longest side of an invented box [pixel]."""


class NoisyOptions(Section):
    """What a noisy detector needs beside the errors it makes."""

    of: str
    """The detector of the cell whose answers it spoils."""
    classes: tuple[str, ...]
    """The classes it confuses and invents."""


class NoisyDetector:
    """Spoils another detector's answers; implements `executive.cell.protocols.Detector`.

    Every look anew, and the same for the same seed, it leaves out a share `misses` of what the other found,
    gives a share `confused` a wrong class with low confidence, moves every box by a normal deviate of
    `jitter` along each axis, and adds `invented` boxes in the mean: the very figures of its section of the
    cell file, which say how far its looks can be trusted.

    Attributes:
        is_fake: True: its error rates are exact as stated, so that they need not be measured.
    """

    is_fake = True

    def __init__(self, config: DetectorConfig, options: NoisyOptions, setting: DetectorSetting) -> None:
        self._config = config
        self._options = options
        self._setting = setting
        self._other: Detector = setting.other(options.of)

    @classmethod
    def from_config(cls, config: DetectorConfig, setting: DetectorSetting) -> NoisyDetector:
        """Return the detector that a cell file describes.

        Raises:
            InputError: An option is missing, unknown or wrong.
        """
        return cls(config, read_options(NoisyOptions, config), setting)

    @staticmethod
    def check(config: DetectorConfig, base: Path, others: Mapping[str, DetectorConfig]) -> OptionFaults:
        """Yield every option because of which it could not be built, with a sentence."""
        del base
        wrong = list(find_wrong_options(NoisyOptions, config))
        yield from wrong
        if not wrong and config.options["of"] not in others:
            yield "of", f'the cell has no detector "{config.options["of"]}"; it has: {", ".join(others)}'

    def request(self, frame: Frame, view: str) -> ChangedRequest:
        """Ask the other detector about `frame`."""
        asked = self._other.request(frame, view)
        return ChangedRequest(asked, lambda answer: self._spoilt(answer, frame, view))

    def close(self) -> None:
        """Have nothing to give back."""

    def _spoilt(self, answer: Answer, frame: Frame, view: str) -> Answer:
        """Return an answer with errors, drawn from the seed and the number of the frame."""
        random = np.random.default_rng([self._setting.seed, frame.id, len(view)])
        kept = [one for one in answer.found if random.random() >= self._config.misses]
        found = [self._moved(self._confused(one, random), random) for one in kept]
        found += [self._invented(frame, view, random) for _ in range(random.poisson(self._config.invented))]
        found.sort(key=lambda detection: -detection.confidence)
        return Answer(self._setting.name, tuple(found), self._config.error_rates)

    def _confused(self, detection: Detection, random: np.random.Generator) -> Detection:
        if random.random() >= self._config.confused:
            return detection
        wrong = [label for label in self._options.classes if label != detection.label]
        return replace(
            detection,
            label=str(random.choice(wrong)),
            confidence=self._confidence(MAX_CONFUSED_CONFIDENCE, random),
        )

    def _moved(self, detection: Detection, random: np.random.Generator) -> Detection:
        right, down = random.normal(0.0, self._config.jitter, 2)
        x0, y0, x1, y1 = detection.box
        return replace(detection, box=(x0 + right, y0 + down, x1 + right, y1 + down))

    def _invented(self, frame: Frame, view: str, random: np.random.Generator) -> Detection:
        height, width = frame.image.shape[:2]
        left, top, right, bottom = (
            self._setting.camera.table_view if view == "table" else (0, 0, width, height)
        )
        x, y = random.uniform((left, top), (right, bottom))
        half_width, half_height = random.uniform(*INVENTED_SIDE_RANGE, 2) / 2
        box = (x - half_width, y - half_height, x + half_width, y + half_height)
        return Detection(str(random.choice(self._options.classes)), self._confidence(1.0, random), box)

    def _confidence(self, most: float, random: np.random.Generator) -> float:
        return float(random.uniform(self._config.floor, most))
