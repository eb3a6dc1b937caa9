"""A model behind a Roboflow inference server as a detector."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from executive.cell_config import DetectorConfig
from executive.errors import DeadlinePassed, InputError, Unavailable
from executive.messages import Detection, Frame
from executive.vision.detectors.requests import Pending, Worker
from executive.vision.detectors.roboflow.answers import read_answer
from executive.vision.detectors.roboflow.complaints import failed, late, unbelievable
from executive.vision.detectors.roboflow.helper import Helper, NoAnswer
from executive.vision.detectors.roboflow.key import ApiKey
from executive.vision.detectors.roboflow.options import RoboflowOptions, wrong_roboflow
from executive.vision.detectors.setting import Setting
from executive.vision.detectors.views import Finding, Part, merge, parts_of, without_duplicates


class RoboflowDetector:
    """Has a server search frames, hosted or one's own; implements `executive.cell.Detector`.

    Args:
        config: Threshold, floor and latency.
        options: Which server and model.
        setting: What it is built into.
        key: What the server knows its user by.
    """

    def __init__(
        self, config: DetectorConfig, options: RoboflowOptions, setting: Setting, key: ApiKey
    ) -> None:
        self._config = config
        self._options = options
        self._setting = setting
        server = {"url": options.url, "model_id": options.model_id, "api": options.api}
        self._helper = Helper({**server, "confidence": config.floor}, key)
        self._worker = Worker(setting.name)

    @classmethod
    def from_config(cls, config: DetectorConfig, setting: Setting) -> RoboflowDetector:
        """Return the detector that a cell file describes; nobody is asked yet, and no key is needed for it.

        Raises:
            InputError: An option is missing, unknown or wrong.
        """
        for _, sentence in wrong_roboflow(config):
            raise InputError(sentence)
        return cls(config, RoboflowOptions.model_validate(config.options), setting, ApiKey())

    @staticmethod
    def check(
        config: DetectorConfig, base: Path, others: Mapping[str, DetectorConfig]
    ) -> Iterator[tuple[str, str]]:
        """Yield every option because of which the detector could not be built, with a sentence."""
        del base, others
        yield from wrong_roboflow(config)

    @staticmethod
    def labels(config: DetectorConfig, base: Path) -> tuple[str, ...] | None:
        """Return the classes it finds, by the cell's names; None where its options do not say."""
        del base
        if any(True for _ in wrong_roboflow(config)):
            return None
        options = RoboflowOptions.model_validate(config.options)
        return tuple(options.class_map.get(name, name) for name in options.labels) or None

    def request(self, frame: Frame, view: str) -> Pending:
        """Start to search `frame`: the `table` part or the `full` image."""
        height, width = frame.image.shape[:2]
        parts = [(0, 0, width, height)]
        if view != "full" or self._options.full == "tiles":
            parts = parts_of(view, self._setting.camera.table_view, (width, height))

        def search() -> list[Detection]:
            return self._search(frame.image, parts)

        now = self._setting.clock.now
        return Pending(
            self._worker.submit(search),
            now + self._config.latency,
            self._setting.clock,
            detector=self._setting.name,
            reliability=self._config.reliability,
            given_up=now + self._options.deadline,
        )

    def close(self) -> None:
        """End the helper process and the thread, whatever they are waiting for."""
        self._helper.stop()
        self._worker.close()
        self._helper.close()

    def _search(self, image: NDArray[np.uint8], parts: Sequence[Part]) -> list[Detection]:
        height, width = image.shape[:2]
        self._helper.wait_until_ready()
        until = time.monotonic() + self._options.deadline
        findings = [Finding(found, part) for part in parts for found in self._search_part(image, part, until)]
        return merge(findings, (width, height))

    def _search_part(self, image: NDArray[np.uint8], part: Part, until: float) -> list[Detection]:
        """Return what the server finds in a part of an image, in the image's pixels."""
        left, top, right, bottom = part
        try:
            message = self._helper.ask(image[top:bottom, left:right], until)
        except NoAnswer as error:
            raise DeadlinePassed(late(error.repeats, self._options)) from None
        if "failure" in message:
            raise Unavailable(failed(message, self._options))
        try:
            answer = read_answer(message["answer"], (right - left, bottom - top))
        except ValueError as error:
            raise Unavailable(unbelievable(str(error), self._options)) from None
        found = []
        for detection in sorted(answer, key=lambda detection: -detection.confidence):
            if detection.confidence >= self._config.floor:
                x0, y0, x1, y1 = detection.box
                label = self._options.class_map.get(detection.label, detection.label)
                box = left + x0, top + y0, left + x1, top + y1
                found.append(Detection(label, detection.confidence, box))
        return without_duplicates(found)
