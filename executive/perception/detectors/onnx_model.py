"""Exported RF-DETR model in onnxruntime, with pre-processing and post-processing.

Conventions of an export by rfdetr: input `(1, 3, R, R)`, RGB in 0..1, normalized with ImageNet's mean and
standard deviation; outputs `dets` `(1, Q, 4)`, centre x, y, width, height in 0..1, and `labels`
`(1, Q, C + 1)`, logits with the background last.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell.detection import Detection
from executive.cell.frame import Box
from executive.errors import InputError, Unavailable
from executive.perception.detectors.views import remove_duplicates

CHANNEL_MEAN = np.array([0.485, 0.456, 0.406], dtype=np.float32)
"""Mean of ImageNet's images, for each channel, 0 to 1."""
CHANNEL_STD = np.array([0.229, 0.224, 0.225], dtype=np.float32)
"""Standard deviation of ImageNet's images, for each channel, 0 to 1."""


class OnnxModel:
    """An exported RF-DETR model.

    Args:
        path: The ONNX file.
        labels: Class names in the order of the model's outputs.
        threads: Maximum number of threads of one inference; also limited by `OMP_NUM_THREADS`.

    Raises:
        InputError: The file cannot be read, is not an RF-DETR model, or does not have one class per label.
    """

    def __init__(self, path: Path, labels: Sequence[str], threads: int = 2) -> None:
        # The import takes 0.1 s and 40 MB, and many runs use no model.
        from onnxruntime import InferenceSession, SessionOptions

        if not path.is_file():
            raise InputError(describe_missing_model(path))
        options = SessionOptions()
        limit = os.environ.get("OMP_NUM_THREADS", "")
        options.intra_op_num_threads = min(threads, int(limit)) if limit.isdecimal() else threads
        options.inter_op_num_threads = 1
        # Threads that spin while they wait would slow down the simulation.
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        options.log_severity_level = 3
        try:
            self._session = InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        except Exception as error:
            raise InputError(f"{path} is not a model that onnxruntime can run: {error}") from error
        self.labels = tuple(labels)
        self.input_size = self._check_shapes(path)

    @staticmethod
    def load(path: Path, labels: Sequence[str], threads: int = 2) -> OnnxModel:
        """Return the model in a file, with the arguments of the class.

        Unchanged models are loaded once per process, because a worker of a sweep runs a mission many times,
        and loading takes 0.2 s.
        """
        change_time = path.stat().st_mtime_ns if path.is_file() else 0
        return _load_model(path, tuple(labels), threads, change_time)

    def detect(self, image: NDArray[np.uint8], min_confidence: float) -> list[Detection]:
        """Return the detections of at least `min_confidence` in an RGB image `(H, W, 3)`, best first.

        Raises:
            Unavailable: onnxruntime failed.
        """
        try:
            boxes, logits = self._session.run(["dets", "labels"], {"input": self._make_input(image)})
        except Exception as error:
            raise Unavailable(f"onnxruntime failed: {error}") from error
        confidences = 1 / (1 + np.exp(-logits[0, :, :-1].astype(np.float64)))
        image_size = np.array(image.shape[1::-1], dtype=float)
        detections = []
        for query, label in np.argwhere(confidences >= min_confidence):
            centre, box_size = boxes[0, query].astype(np.float64).reshape(2, 2) * image_size
            left, top = np.clip(centre - box_size / 2, 0, image_size)
            right, bottom = np.clip(centre + box_size / 2, 0, image_size)
            box: Box = (float(left), float(top), float(right), float(bottom))
            second = float(max(np.delete(confidences[query], label), default=0.0))
            detections.append(Detection(self.labels[label], float(confidences[query, label]), box, second))
        return remove_duplicates(sorted(detections, key=lambda detection: -detection.confidence))

    def _make_input(self, image: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Return the normalized image `(1, 3, R, R)`."""
        size = (self.input_size, self.input_size)
        if image.shape[:2] != size:
            # Area averaging uses all pixels and does not move edges; bilinear resizing would skip pixels.
            is_larger = min(image.shape[:2]) > self.input_size
            interpolation = cv2.INTER_AREA if is_larger else cv2.INTER_LINEAR
            image = np.asarray(cv2.resize(image, size, interpolation=interpolation), dtype=np.uint8)
        normalized = (image.astype(np.float32) / 255 - CHANNEL_MEAN) / CHANNEL_STD
        return np.ascontiguousarray(normalized.transpose(2, 0, 1)[None])

    def _check_shapes(self, path: Path) -> int:
        """Check names and shapes of inputs and outputs, and return the side of the input image [pixel]."""
        inputs = {node.name: node.shape for node in self._session.get_inputs()}
        outputs = {node.name: node.shape for node in self._session.get_outputs()}
        if list(inputs) != ["input"] or not {"dets", "labels"} <= set(outputs):
            raise InputError(
                f"{path} is not an exported RF-DETR model: it has the inputs {', '.join(inputs)} and the "
                f'outputs {", ".join(outputs)}, but needs the input "input" and the outputs "dets", "labels"'
            )
        size, output_count = inputs["input"][-1], outputs["labels"][-1]
        if not isinstance(size, int) or not isinstance(output_count, int):
            raise InputError(f"{path} has an input or output of variable size; export it with fixed sizes")
        class_count = output_count - 1
        if class_count != len(self.labels):
            labels = f"{len(self.labels)} labels: {', '.join(self.labels)}"
            advice = "give one label per class, in the order of the model"
            raise InputError(f"{path} has {class_count} classes, but there are {labels}; {advice}")
        return size


@functools.lru_cache(maxsize=4)
def _load_model(path: Path, labels: tuple[str, ...], threads: int, change_time: int) -> OnnxModel:
    del change_time  # The argument only distinguishes versions of a file.
    return OnnxModel(path, labels, threads)


def describe_missing_model(path: Path) -> str:
    """Return the error message for a missing model file."""
    return f"there is no model file {path}; check the path, relative to the cell file"


def read_labels(path: Path) -> tuple[str, ...]:
    """Return the class names in a text file, one per line.

    Raises:
        InputError: The file does not exist, is not a text file, or is empty.
    """
    if not path.is_file():
        advice = "it needs one class name per line, in the order of the model"
        raise InputError(f"there is no label file {path}; {advice}")
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"the label file {path} cannot be read: {error}") from error
    names = tuple(line.strip() for line in lines if line.strip())
    if not names:
        raise InputError(f"the label file {path} is empty; it needs one class name per line")
    return names
