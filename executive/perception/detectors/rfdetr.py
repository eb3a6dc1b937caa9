"""Detector that runs an exported RF-DETR model, an ONNX file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from executive.cell.config import DetectorConfig
from executive.cell.frame import Detection
from executive.errors import InputError
from executive.perception.detectors import onnx_model
from executive.perception.detectors.detector_registry import (
    DetectorOptions,
    OptionErrors,
    find_class_map_errors,
)
from executive.perception.detectors.onnx_model import OnnxModel, describe_missing_model, read_labels
from executive.perception.detectors.requests import DetectorContext, ThreadedDetector
from executive.perception.detectors.views import Region, search_regions
from executive.perception.envelope import is_measured


class RfdetrOptions(DetectorOptions):
    """Options of a detector of kind `rfdetr`."""

    model_path: str
    """Path of the exported model (`.onnx`), relative to the folder of the cell file."""
    labels: tuple[str, ...] | str
    """Class names in the order of the model's outputs, or the path of a text file with one name per line."""
    class_map: dict[str, str] = Field(default_factory=dict)
    """Class names of the cell by class names of the model, if the names differ."""
    threads: int = Field(2, ge=1, le=64)
    """Maximum number of threads of one inference."""

    def read_names(self, base: Path) -> tuple[str, ...]:
        """Return the class names of the model; `base` is the folder of the cell file.

        Raises:
            InputError: The text file cannot be read.
        """
        return read_labels(base / self.labels) if isinstance(self.labels, str) else self.labels


class RfdetrDetector(ThreadedDetector):
    """Detector that runs a model in a thread; implements `executive.cell.protocols.Detector`.

    Args:
        model: The model.
        config: Section of the detector in the cell file.
        context: Parts of the cell and of the run that the detector uses.
        class_map: Class names of the cell by class names of the model, if the names differ.
    """

    def __init__(
        self, model: OnnxModel, config: DetectorConfig, context: DetectorContext, class_map: Mapping[str, str]
    ) -> None:
        super().__init__(config, context)
        self._model, self._class_map = model, class_map

    @classmethod
    def from_config(cls, config: DetectorConfig, context: DetectorContext) -> RfdetrDetector:
        """Return the detector for a section of a cell file.

        Raises:
            InputError: An option is missing, unknown or invalid, or the model cannot be read.
        """
        folder = context.cell_folder
        for _, message in cls.check(config, folder, {}):
            raise InputError(message)
        options = cls._read_options(config)
        model = OnnxModel.load(folder / options.model_path, options.read_names(folder), options.threads)
        return cls(model, config, context, options.class_map)

    @staticmethod
    def check(config: DetectorConfig, base: Path, all_configs: Mapping[str, DetectorConfig]) -> OptionErrors:
        """Yield each missing, unknown or invalid option, with an error message.

        A model without a measurement is tried out, in a child process; a measured model has run.
        """
        del all_configs
        errors = list(RfdetrOptions.find_errors(config))
        yield from errors
        if errors:
            return
        options = RfdetrOptions.read(config)
        path = base / options.model_path
        if not path.is_file():
            yield "model_path", describe_missing_model(path)
        try:
            names = options.read_names(base)
        except InputError as error:
            yield "labels", str(error)
            return
        errors = list(find_class_map_errors(config, options.class_map, names))
        if not errors and path.is_file() and not is_measured(path, base):
            messages = onnx_model.find_model_errors(path, names, path.stat().st_mtime_ns)
            errors = [("model_path", message) for message in messages]
        yield from errors

    @classmethod
    def labels(cls, config: DetectorConfig, base: Path) -> tuple[str, ...] | None:
        """Return the class names of the cell that the model can find; None if the options are invalid."""
        try:
            options = cls._read_options(config)
            return tuple(options.class_map.get(name, name) for name in options.read_names(base))
        except InputError:
            return None

    @classmethod
    def weights(cls, config: DetectorConfig, base: Path) -> Path | None:
        """Return the path of the model file; None if the options are invalid."""
        try:
            return base / cls._read_options(config).model_path
        except InputError:
            return None

    @staticmethod
    def _read_options(config: DetectorConfig) -> RfdetrOptions:
        return RfdetrOptions.read(config)

    def _search(self, image: NDArray[np.uint8], regions: Sequence[Region]) -> list[Detection]:
        detect = partial(self._model.detect, min_confidence=self._config.floor)
        return search_regions(image, regions, detect, self._class_map)
