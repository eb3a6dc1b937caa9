"""Detector that sends images to a Roboflow inference server."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import DetectorConfig
from executive.cell.detection import Detection
from executive.errors import DeadlinePassed, InputError, Unavailable
from executive.perception.detectors.options import OptionErrors
from executive.perception.detectors.requests import DetectorContext, ThreadedDetector
from executive.perception.detectors.roboflow import failure_messages
from executive.perception.detectors.roboflow.answers import read_answer, read_output
from executive.perception.detectors.roboflow.inference_process import InferenceProcess, NoAnswer
from executive.perception.detectors.roboflow.key import ApiKey
from executive.perception.detectors.roboflow.server_options import WORKFLOW_OPTIONS, RoboflowOptions
from executive.perception.detectors.views import Region, remove_duplicates, search_regions


class RoboflowDetector(ThreadedDetector):
    """Client of a hosted or self-hosted inference server; implements `executive.cell.protocols.Detector`.

    Args:
        config: Section of the detector in the cell file.
        options: Options of this kind of detector.
        context: Parts of the cell and of the run that the detector uses.
        key: API key of the user.
    """

    def __init__(self, config: DetectorConfig, options: RoboflowOptions, context: DetectorContext) -> None:
        super().__init__(config, context, options.deadline)
        self._options = options
        self._read_answer = read_output if options.api == "workflow" else read_answer
        server = options.model_dump(include={"url", "model_id", "api", *WORKFLOW_OPTIONS})
        # A proxy cannot reach a server on this computer.
        environment = {**os.environ, "no_proxy": "*"} if options.is_local else os.environ
        self._process = InferenceProcess({**server, "confidence": config.floor}, ApiKey(environment))

    @classmethod
    def from_config(cls, config: DetectorConfig, context: DetectorContext) -> RoboflowDetector:
        """Return the detector for a section of a cell file, without a request and without an API key.

        Raises:
            InputError: An option is missing, unknown or invalid.
        """
        return cls(config, RoboflowOptions.read(config), context)

    @staticmethod
    def check(config: DetectorConfig, base: Path, all_configs: Mapping[str, DetectorConfig]) -> OptionErrors:
        """Yield each invalid option, with a message."""
        del base, all_configs
        yield from RoboflowOptions.find_errors(config)

    @staticmethod
    def labels(config: DetectorConfig, base: Path) -> tuple[str, ...] | None:
        """Return the class names of the cell that the model can find; None if the options list none."""
        del base
        try:
            options = RoboflowOptions.read(config)
        except InputError:
            return None
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
        detect = partial(self._detect_in_crop, deadline=deadline)
        return search_regions(image, regions, detect, self._options.class_map)

    def _detect_in_crop(self, crop: NDArray[np.uint8], deadline: float) -> list[Detection]:
        """Return the detections of the server in a crop of a frame, with boxes in pixels of the crop."""
        try:
            message = self._process.request(crop, deadline)
        except NoAnswer as error:
            text = failure_messages.describe_missed_deadline(error.retry_causes, self._options)
            raise DeadlinePassed(text) from None
        if "failure" in message:
            raise Unavailable(failure_messages.describe_failure(message, self._options))
        try:
            detections = self._read_answer(message["answer"], (crop.shape[1], crop.shape[0]))
        except (ValueError, RecursionError) as error:
            text = failure_messages.describe_invalid_answer(str(error), self._options)
            raise Unavailable(text) from None
        detections = [detection for detection in detections if detection.confidence >= self._config.floor]
        return remove_duplicates(sorted(detections, key=lambda detection: -detection.confidence))
