"""A model behind a Roboflow inference server as a detector."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import DetectorConfig
from executive.cell.detection import Detection
from executive.cell.frame import Frame
from executive.errors import DeadlinePassed, InputError, Unavailable
from executive.perception.detectors.options import OptionFaults
from executive.perception.detectors.requests import Pending
from executive.perception.detectors.roboflow.answers import read_answer, read_output
from executive.perception.detectors.roboflow.complaints import failed, late, unbelievable
from executive.perception.detectors.roboflow.helper import Helper, NoAnswer
from executive.perception.detectors.roboflow.key import ApiKey
from executive.perception.detectors.roboflow.options import WORKFLOW, RoboflowOptions, wrong_roboflow
from executive.perception.detectors.setting import Setting
from executive.perception.detectors.views import Part, parts_of, search_parts, without_duplicates


class RoboflowDetector:
    """Has a server search frames, hosted or one's own; implements `executive.cell.protocols.Detector`.

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
        self._read = read_output if options.api == "workflow" else read_answer
        server = options.model_dump(include={"url", "model_id", "api", *WORKFLOW})
        self._helper = Helper({**server, "confidence": config.floor}, key)
        self._thread = ThreadPoolExecutor(1, f"detector-{setting.name}")

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
    def check(config: DetectorConfig, base: Path, others: Mapping[str, DetectorConfig]) -> OptionFaults:
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
        work = self._thread.submit(lambda: self._search(frame.image, parts))
        clock = self._setting.clock
        due, given_up = clock.now + self._config.latency, clock.now + self._options.deadline
        return Pending(work, due, clock, self._setting.name, self._config.error_rates, given_up)

    def close(self) -> None:
        """End the helper process and the thread, whatever they are waiting for."""
        self._helper.stop()
        self._thread.shutdown(cancel_futures=True)
        self._helper.close()

    def _search(self, image: NDArray[np.uint8], parts: Sequence[Part]) -> list[Detection]:
        self._helper.wait_until_ready()
        until = time.monotonic() + self._options.deadline
        return search_parts(image, parts, lambda crop: self._find(crop, until), self._options.class_map)

    def _find(self, crop: NDArray[np.uint8], until: float) -> list[Detection]:
        """Return what the server finds in a part of a frame, in that part's pixels."""
        try:
            message = self._helper.ask(crop, until)
        except NoAnswer as error:
            raise DeadlinePassed(late(error.repeats, self._options)) from None
        if "failure" in message:
            raise Unavailable(failed(message, self._options))
        try:
            answer = self._read(message["answer"], (crop.shape[1], crop.shape[0]))
        except ValueError as error:
            raise Unavailable(unbelievable(str(error), self._options)) from None
        found = [one for one in answer if one.confidence >= self._config.floor]
        return without_duplicates(sorted(found, key=lambda one: -one.confidence))
