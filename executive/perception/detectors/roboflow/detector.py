"""Detector that sends images to a Roboflow inference server."""

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
from executive.perception.detectors.roboflow.failure_messages import (
    describe_delay,
    describe_failure,
    describe_invalid_answer,
)
from executive.perception.detectors.roboflow.inference_process import InferenceProcess, NoAnswer
from executive.perception.detectors.roboflow.key import ApiKey
from executive.perception.detectors.roboflow.server_options import (
    WORKFLOW_OPTIONS,
    RoboflowOptions,
    find_roboflow_option_errors,
)
from executive.perception.detectors.setting import DetectorSetting, OptionErrors
from executive.perception.detectors.views import Region, remove_duplicates, search_regions


class RoboflowDetector(ThreadedDetector):
    """Client of a hosted or self-hosted inference server; implements `executive.cell.protocols.Detector`.

    Args:
        config: Section of the detector in the cell file.
        options: Options of this kind of detector.
        setting: Parts of the cell and of the run that the detector uses.
        key: API key of the user.
    """

    def __init__(
        self, config: DetectorConfig, options: RoboflowOptions, setting: DetectorSetting, key: ApiKey
    ) -> None:
        super().__init__(config, setting, options.deadline)
        self._options = options
        self._read_answer = read_output if options.api == "workflow" else read_answer
        server = options.model_dump(include={"url", "model_id", "api", *WORKFLOW_OPTIONS})
        self._process = InferenceProcess({**server, "confidence": config.floor}, key)

    @classmethod
    def from_config(cls, config: DetectorConfig, setting: DetectorSetting) -> RoboflowDetector:
        """Return the detector for a section of a cell file; sends no request and needs no API key.

        Raises:
            InputError: An option is missing, unknown or invalid.
        """
        for _, message in find_roboflow_option_errors(config):
            raise InputError(message)
        return cls(config, RoboflowOptions.model_validate(config.options), setting, ApiKey())

    @staticmethod
    def check(config: DetectorConfig, base: Path, others: Mapping[str, DetectorConfig]) -> OptionErrors:
        """Yield each invalid option, with a message."""
        del base, others
        yield from find_roboflow_option_errors(config)

    @staticmethod
    def labels(config: DetectorConfig, base: Path) -> tuple[str, ...] | None:
        """Return the class names of the cell that the model can find; None if not listed in the options."""
        del base
        if list(find_roboflow_option_errors(config)):
            return None
        options = RoboflowOptions.model_validate(config.options)
        return tuple(options.class_map.get(name, name) for name in options.labels) or None

    def _list_regions(self, view: str, size: tuple[int, ...]) -> list[Region]:
        is_whole_image = view == "full" and self._options.full == "whole"
        return [(0, 0, size[0], size[1])] if is_whole_image else super()._list_regions(view, size)

    def close(self) -> None:
        """End the helper process and the thread; a running request fails."""
        self._process.stop()
        super().close()
        self._process.close()

    def _search(self, image: NDArray[np.uint8], regions: Sequence[Region]) -> list[Detection]:
        self._process.wait_until_ready()
        deadline = time.monotonic() + self._options.deadline
        return search_regions(
            image, regions, lambda crop: self._detect_in_crop(crop, deadline), self._options.class_map
        )

    def _detect_in_crop(self, crop: NDArray[np.uint8], deadline: float) -> list[Detection]:
        """Return the detections of the server in a crop of a frame, with boxes in pixels of the crop."""
        try:
            message = self._process.request(crop, deadline)
        except NoAnswer as error:
            raise DeadlinePassed(describe_delay(error.retry_causes, self._options)) from None
        if "failure" in message:
            raise Unavailable(describe_failure(message, self._options))
        try:
            answer = self._read_answer(message["answer"], (crop.shape[1], crop.shape[0]))
        except ValueError as error:
            raise Unavailable(describe_invalid_answer(str(error), self._options)) from None
        detections = [detection for detection in answer if detection.confidence >= self._config.floor]
        return remove_duplicates(sorted(detections, key=lambda detection: -detection.confidence))
