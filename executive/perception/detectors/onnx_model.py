"""Exported RF-DETR model, run by onnxruntime, with its pre-processing and post-processing.

Conventions of rfdetr's export: input `(1, 3, R, R)`, RGB in 0..1, normalized with ImageNet's mean and
standard deviation; outputs `dets` `(1, Q, 4)`, centre x, y, width, height in 0..1, and `labels`
`(1, Q, C + 1)`, logits with the background last.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell.detection import Detection
from executive.cell.frame import Box
from executive.errors import InputError, Unavailable
from executive.geometry import Array
from executive.perception.detectors.views import remove_duplicates

MEAN = np.array([0.485, 0.456, 0.406], dtype=np.float32)
STANDARD_DEVIATION = np.array([0.229, 0.224, 0.225], dtype=np.float32)


class OnnxModel:
    """An exported RF-DETR model.

    Args:
        path: The ONNX file.
        labels: Class names in the order of the model's outputs.
        threads: Maximum number of threads of one inference.

    Raises:
        InputError: The file cannot be read, is no RF-DETR, or has another number of classes.
    """

    def __init__(self, path: Path, labels: Sequence[str], threads: int = 2) -> None:
        # The import takes 0.1 s and 40 MB, which only runs with a model need.
        import onnxruntime

        if not path.is_file():
            raise InputError(describe_missing_model(path))
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        options.inter_op_num_threads = 1
        # Threads that spin while they wait take the processor from the simulation.
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        options.log_severity_level = 3
        try:
            self._session = onnxruntime.InferenceSession(
                str(path), options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:
            raise InputError(f"{path} is not a model that onnxruntime can run: {error}") from error
        self.labels = tuple(labels)
        self.size = self._check_shapes(path)

    def detect(self, image: NDArray[np.uint8], floor: float) -> list[Detection]:
        """Return the detections in an RGB image `(H, W, 3)`, most confident first.

        Detections with a confidence below `floor` are left out.

        Raises:
            Unavailable: onnxruntime failed.
        """
        try:
            boxes, logits = self._session.run(["dets", "labels"], {"input": self._prepare(image)})
        except Exception as error:
            raise Unavailable(f"onnxruntime failed: {error}") from error
        confidences = 1 / (1 + np.exp(-logits[0, :, :-1].astype(np.float64)))
        found = self._decode(boxes[0].astype(np.float64), confidences, image.shape[1], image.shape[0], floor)
        return remove_duplicates(found)

    def _prepare(self, image: NDArray[np.uint8]) -> NDArray[np.float32]:
        if image.shape[:2] != (self.size, self.size):
            image = np.asarray(
                cv2.resize(image, (self.size, self.size), interpolation=cv2.INTER_LINEAR), dtype=np.uint8
            )
        normalized = (image.astype(np.float32) / 255 - MEAN) / STANDARD_DEVIATION
        return np.ascontiguousarray(normalized.transpose(2, 0, 1)[None])

    def _decode(
        self, boxes: Array, confidences: Array, width: int, height: int, floor: float
    ) -> list[Detection]:
        size = np.array([width, height], dtype=float)
        found = []
        for query, label in np.argwhere(confidences >= floor):
            centre, extent = boxes[query, :2] * size, boxes[query, 2:] * size
            left, top = np.clip(centre - extent / 2, 0, size)
            right, bottom = np.clip(centre + extent / 2, 0, size)
            box: Box = (float(left), float(top), float(right), float(bottom))
            rival = max(np.delete(confidences[query], label), default=0.0)
            found.append(Detection(self.labels[label], float(confidences[query, label]), box, float(rival)))
        return sorted(found, key=lambda detection: -detection.confidence)

    def _check_shapes(self, path: Path) -> int:
        """Return the side of the input [pixel], after a check of all inputs and outputs."""
        inputs = {node.name: node.shape for node in self._session.get_inputs()}
        outputs = {node.name: node.shape for node in self._session.get_outputs()}
        if list(inputs) != ["input"] or not {"dets", "labels"} <= set(outputs):
            raise InputError(
                f"{path} is no exported RF-DETR: it takes {', '.join(inputs)} and gives "
                f"{', '.join(outputs)}, where input, dets and labels were expected"
            )
        size, classes = inputs["input"][-1], outputs["labels"][-1]
        if not isinstance(size, int):
            raise InputError(f"{path} has an input of variable size; export it with a fixed one")
        if classes != len(self.labels) + 1:
            raise InputError(
                f"{path} has {classes - 1} classes and {len(self.labels)} labels were given: "
                f"{', '.join(self.labels)}; give one label per class, in the model's order"
            )
        return size


def describe_missing_model(path: Path) -> str:
    """Return the error message for a missing model file."""
    return f"there is no model file {path}; check the path, relative to the cell file"


def read_labels(path: Path) -> tuple[str, ...]:
    """Return the class names in a text file, one per line.

    Raises:
        InputError: The file does not exist, is not a text file, or is empty.
    """
    if not path.is_file():
        raise InputError(f"there is no label file {path}; it has one class name a line, in the model's order")
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"the label file {path} cannot be read: {error}") from error
    names = tuple(line.strip() for line in lines if line.strip())
    if not names:
        raise InputError(f"the label file {path} is empty; it has one class name a line")
    return names
