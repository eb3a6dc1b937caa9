"""Any exported RF-DETR model as a detector: an ONNX file, run by onnxruntime."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from executive.cell import Clock
from executive.cell_config import CameraConfig, DetectorConfig, Section
from executive.errors import InputError
from executive.messages import Detection, Frame
from executive.vision.detectors.onnx_model import OnnxModel, read_labels
from executive.vision.detectors.requests import Pending, Worker
from executive.vision.detectors.views import Finding, Part, merge, parts_of

OptionsT = TypeVar("OptionsT", bound=Section)


class RfdetrOptions(Section):
    """What a detector of kind `rfdetr` has to know beside what every detector has."""

    model_path: str
    """The exported model (`.onnx`), from the cell file's folder."""
    labels: tuple[str, ...] | str
    """Class names in the order of the model's outputs, or a text file with one a line."""
    class_map: dict[str, str] = Field(default_factory=dict)
    """From the model's class names to the cell's, where they differ."""
    threads: int = Field(2, ge=1)
    """Threads one inference may use."""


class RfdetrDetector:
    """Runs a model over parts of a frame, beside the tick loop; implements `executive.cell.Detector`.

    Args:
        model: What finds objects in an image.
        config: Threshold, floor and latency.
        table_view: The square part of a frame that shows the workspace [pixel].
        clock: The run's clock.
        class_map: From the model's class names to the cell's, where they differ.
    """

    def __init__(
        self,
        model: OnnxModel,
        config: DetectorConfig,
        *,
        table_view: Part,
        clock: Clock,
        class_map: Mapping[str, str] | None = None,
    ) -> None:
        self._model = model
        self._config = config
        self._table_view = table_view
        self._clock = clock
        self._class_map = dict(class_map or {})
        self._worker = Worker(config.kind)

    @classmethod
    def from_config(
        cls, config: DetectorConfig, *, camera: CameraConfig, clock: Clock, base: Path
    ) -> RfdetrDetector:
        """Return the detector that a cell file describes.

        Args:
            config: Its section of the cell file.
            camera: The camera whose frames it searches.
            clock: The run's clock.
            base: Folder that paths start from.

        Raises:
            InputError: An option is missing, unknown or wrong, or the model cannot be read.
        """
        options = read_options(RfdetrOptions, config)
        labels = options.labels
        names = read_labels(base / labels) if isinstance(labels, str) else labels
        strangers = [name for name in options.class_map if name not in names]
        if strangers:
            raise InputError(
                f"class_map of a detector of kind {config.kind} names {', '.join(strangers)}, which "
                f"the model does not know; it knows {', '.join(names)}"
            )
        model = OnnxModel(base / options.model_path, names, options.threads)
        return cls(model, config, table_view=camera.table_view, clock=clock, class_map=options.class_map)

    @property
    def threshold(self) -> float:
        """Confidence from which a detection counts."""
        return self._config.threshold

    @property
    def labels(self) -> tuple[str, ...]:
        """The classes it can find, by the cell's names."""
        return tuple(self._class_map.get(label, label) for label in self._model.labels)

    def request(self, frame: Frame, view: str) -> Pending:
        """Start to search `frame`: the `table` part or the `full` image."""
        height, width = frame.image.shape[:2]
        parts = parts_of(view, self._table_view, (width, height))

        def search() -> list[Detection]:
            return self._search(frame.image, parts)

        return self._worker.submit(search, frame.stamp + self._config.latency, self._clock)

    def close(self) -> None:
        """End the thread and wait for the search under way."""
        self._worker.close()

    def _search(self, image: NDArray[np.uint8], parts: Sequence[Part]) -> list[Detection]:
        height, width = image.shape[:2]
        findings = [Finding(found, part) for part in parts for found in self._search_part(image, part)]
        return merge(findings, (width, height))

    def _search_part(self, image: NDArray[np.uint8], part: Part) -> list[Detection]:
        left, top, right, bottom = part
        crop = image[top:bottom, left:right]
        size = self._model.size
        if crop.shape[0] > size and crop.shape[1] > size:
            # Averaging keeps edges where they are; the model's own bilinear resize would skip pixels.
            crop = np.asarray(cv2.resize(crop, (size, size), interpolation=cv2.INTER_AREA), dtype=np.uint8)
        scale_x, scale_y = (right - left) / crop.shape[1], (bottom - top) / crop.shape[0]
        found = []
        for detection in self._model.detect(crop, self._config.floor):
            x0, y0, x1, y1 = detection.box
            box = (left + x0 * scale_x, top + y0 * scale_y, left + x1 * scale_x, top + y1 * scale_y)
            label = self._class_map.get(detection.label, detection.label)
            found.append(Detection(label, detection.confidence, box))
        return found


def read_options(options: type[OptionsT], config: DetectorConfig) -> OptionsT:
    """Return the options of a kind of detector, checked.

    Raises:
        InputError: An option is missing, unknown or wrong.
    """
    try:
        return options.model_validate(config.options)
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(str(part) for part in first["loc"])
        known = ", ".join(options.model_fields) or "none"
        raise InputError(
            f'option "{name}" of a detector of kind {config.kind}: {first["msg"].lower()}; '
            f"its options: {known}"
        ) from None
