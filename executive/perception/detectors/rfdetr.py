"""Any exported RF-DETR model as a detector: an ONNX file, run by onnxruntime."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from executive.cell.config import DetectorConfig, Section
from executive.cell.detection import Detection
from executive.errors import InputError
from executive.perception.detectors.onnx_model import OnnxModel, no_model, read_labels
from executive.perception.detectors.options import (
    OptionFaults,
    find_wrong_class_map,
    find_wrong_options,
    read_options,
)
from executive.perception.detectors.requests import ThreadedDetector
from executive.perception.detectors.setting import DetectorSetting
from executive.perception.detectors.views import Part, search_parts


class RfdetrOptions(Section):
    """What a detector of kind `rfdetr` has to know beside what every detector has."""

    model_path: str
    """The exported model (`.onnx`), from the cell file's folder."""
    labels: tuple[str, ...] | str
    """Class names in the order of the model's outputs, or a text file with one a line."""
    class_map: dict[str, str] = Field(default_factory=dict)
    """From the model's class names to the cell's, where they differ."""
    threads: int = Field(2, ge=1, le=64)
    """Threads one inference may use."""

    def names(self, base: Path) -> tuple[str, ...]:
        """Return the model's class names; `base` is the folder that paths start from.

        Raises:
            InputError: The file they stand in cannot be read.
        """
        return read_labels(base / self.labels) if isinstance(self.labels, str) else self.labels


class RfdetrDetector(ThreadedDetector):
    """Runs a model over parts of a frame, beside the tick loop; implements `cell.protocols.Detector`.

    Args:
        model: What finds objects in an image.
        config: Threshold, floor and latency.
        setting: What it is built into.
        class_map: From the model's class names to the cell's, where they differ.
    """

    def __init__(
        self,
        model: OnnxModel,
        config: DetectorConfig,
        setting: DetectorSetting,
        class_map: Mapping[str, str] | None = None,
    ) -> None:
        super().__init__(config, setting)
        self._model = model
        self._class_map = dict(class_map or {})

    @classmethod
    def from_config(cls, config: DetectorConfig, setting: DetectorSetting) -> RfdetrDetector:
        """Return the detector that a cell file describes.

        Raises:
            InputError: An option is missing, unknown or wrong, or the model cannot be read.
        """
        for _, sentence in cls.check(config, setting.base, {}):
            raise InputError(sentence)
        options = read_options(RfdetrOptions, config)
        model = OnnxModel(setting.base / options.model_path, options.names(setting.base), options.threads)
        return cls(model, config, setting, options.class_map)

    @staticmethod
    def check(config: DetectorConfig, base: Path, others: Mapping[str, DetectorConfig]) -> OptionFaults:
        """Yield every option because of which the detector could not be built, with a sentence.

        The model is not loaded.
        """
        del others
        wrong = list(find_wrong_options(RfdetrOptions, config))
        yield from wrong
        if wrong:
            return
        options = read_options(RfdetrOptions, config)
        if not (base / options.model_path).is_file():
            yield "model_path", no_model(base / options.model_path)
        try:
            names = options.names(base)
        except InputError as error:
            yield "labels", str(error)
            return
        yield from find_wrong_class_map(config, options.class_map, names)

    @staticmethod
    def labels(config: DetectorConfig, base: Path) -> tuple[str, ...] | None:
        """Return the classes it finds, by the cell's names; None where its options do not say."""
        try:
            options = read_options(RfdetrOptions, config)
            return tuple(options.class_map.get(name, name) for name in options.names(base))
        except InputError:
            return None

    @staticmethod
    def weights(config: DetectorConfig, base: Path) -> Path | None:
        """Return the path of the model file, None if the options do not name it."""
        try:
            return base / read_options(RfdetrOptions, config).model_path
        except InputError:
            return None

    def _search(self, image: NDArray[np.uint8], parts: Sequence[Part]) -> list[Detection]:
        return search_parts(image, parts, self._find, self._class_map)

    def _find(self, crop: NDArray[np.uint8]) -> list[Detection]:
        """Return what the model finds in a part of a frame, in that part's pixels."""
        height, width = crop.shape[:2]
        size = self._model.size
        if height <= size or width <= size:
            return self._model.detect(crop, self._config.floor)
        # Averaging keeps edges where they are; the model's own bilinear resize would skip pixels.
        small = np.asarray(cv2.resize(crop, (size, size), interpolation=cv2.INTER_AREA), dtype=np.uint8)
        x, y = width / size, height / size
        return [
            replace(one, box=(one.box[0] * x, one.box[1] * y, one.box[2] * x, one.box[3] * y))
            for one in self._model.detect(small, self._config.floor)
        ]
