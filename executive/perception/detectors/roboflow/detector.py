"""A model behind a Roboflow inference server as a detector."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import DetectorConfig
from executive.cell.detection import Detection
from executive.errors import DeadlinePassed, InputError, Unavailable
from executive.perception.detectors.requests import ThreadedDetector
from executive.perception.detectors.roboflow.answers import read_answer, read_output
from executive.perception.detectors.roboflow.complaints import (
    describe_delay,
    describe_failure,
    describe_invalid_answer,
)
from executive.perception.detectors.roboflow.helper import Helper, NoAnswer
from executive.perception.detectors.roboflow.key import ApiKey
from executive.perception.detectors.roboflow.options import (
    WORKFLOW_OPTIONS,
    RoboflowOptions,
    find_wrong_roboflow_options,
)
from executive.perception.detectors.setting import DetectorSetting, OptionFaults
from executive.perception.detectors.views import Part, remove_duplicates, search_parts


class RoboflowDetector(ThreadedDetector):
    """Has a server search frames, hosted or one's own; implements `executive.cell.protocols.Detector`.

    Args:
        config: Threshold, floor and latency.
        options: Which server and model.
        setting: What it is built into.
        key: What the server knows its user by.
    """

    def __init__(
        self, config: DetectorConfig, options: RoboflowOptions, setting: DetectorSetting, key: ApiKey
    ) -> None:
        super().__init__(config, setting, options.deadline)
        self._options = options
        self._read = read_output if options.api == "workflow" else read_answer
        server = options.model_dump(include={"url", "model_id", "api", *WORKFLOW_OPTIONS})
        self._helper = Helper({**server, "confidence": config.floor}, key)

    @classmethod
    def from_config(cls, config: DetectorConfig, setting: DetectorSetting) -> RoboflowDetector:
        """Return the detector that a cell file describes; nobody is asked yet, and no key is needed for it.

        Raises:
            InputError: An option is missing, unknown or wrong.
        """
        for _, sentence in find_wrong_roboflow_options(config):
            raise InputError(sentence)
        return cls(config, RoboflowOptions.model_validate(config.options), setting, ApiKey())

    @staticmethod
    def check(config: DetectorConfig, base: Path, others: Mapping[str, DetectorConfig]) -> OptionFaults:
        """Yield every option because of which the detector could not be built, with a sentence."""
        del base, others
        yield from find_wrong_roboflow_options(config)

    @staticmethod
    def labels(config: DetectorConfig, base: Path) -> tuple[str, ...] | None:
        """Return the classes it finds, by the cell's names; None where its options do not say."""
        del base
        if any(True for _ in find_wrong_roboflow_options(config)):
            return None
        options = RoboflowOptions.model_validate(config.options)
        return tuple(options.class_map.get(name, name) for name in options.labels) or None

    def _parts(self, view: str, size: tuple[int, ...]) -> list[Part]:
        is_whole = view == "full" and self._options.full != "tiles"
        return [(0, 0, size[0], size[1])] if is_whole else super()._parts(view, size)

    def close(self) -> None:
        """End the helper process and the thread, whatever they are waiting for."""
        self._helper.stop()
        super().close()
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
            raise DeadlinePassed(describe_delay(error.repeats, self._options)) from None
        if "failure" in message:
            raise Unavailable(describe_failure(message, self._options))
        try:
            answer = self._read(message["answer"], (crop.shape[1], crop.shape[0]))
        except ValueError as error:
            raise Unavailable(describe_invalid_answer(str(error), self._options)) from None
        found = [one for one in answer if one.confidence >= self._config.floor]
        return remove_duplicates(sorted(found, key=lambda one: -one.confidence))
