"""Detectors that run an exported RF-DETR model, an ONNX file; one such model is shipped.

Conventions of an export by rfdetr: input `(1, 3, H, W)`, RGB in 0..1, normalized with ImageNet's mean and
standard deviation; outputs `dets` `(1, Q, 4)`, centre x, y, width, height in 0..1, and `labels`
`(1, Q, C + 1)`, logits with the background last. All values are of float32 or float16.
"""

from __future__ import annotations

import functools
import os
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from executive.cell.config import DetectorConfig
from executive.cell.frame import Box, Detection, Frame
from executive.errors import InputError, Unavailable
from executive.perception.detectors.detector_registry import DetectorContext, DetectorOptions, OptionErrors
from executive.perception.detectors.envelope import is_measured
from executive.perception.detectors.views import list_regions, remove_duplicates, search_regions
from executive.processes import build_command
from executive.text.files import read_file

CHANNEL_MEAN = np.array([0.485, 0.456, 0.406], dtype=np.float32)
"""Mean of ImageNet's images, for each channel, 0 to 1."""
CHANNEL_STD = np.array([0.229, 0.224, 0.225], dtype=np.float32)
"""Standard deviation of ImageNet's images, for each channel, 0 to 1."""

INPUT_TYPES = {"tensor(float)": "float32", "tensor(float16)": "float16"}
"""Supported types of the input, by the name in onnxruntime."""
TRIAL_TIMEOUT = 30.0
"""Maximum time to load a model and to run it once [s]."""
MODEL_PATH = Path(__file__).parent.parent / "weights" / "embedded.onnx"
"""Exported model with the shipped weights."""
LABELS_PATH = MODEL_PATH.with_suffix(".labels.txt")


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
            cause = _explain_load_error(path, error)
            raise InputError(f"{path} is not a model that onnxruntime can run: {cause}") from error
        self.labels = tuple(labels)
        self._check_signature(path)
        (self._input,) = self._session.get_inputs()
        self.input_size: tuple[int, int] = (self._input.shape[3], self._input.shape[2])
        """Width and height of the input image [pixel]."""

    def detect(self, image: NDArray[np.uint8], min_confidence: float) -> list[Detection]:
        """Return the detections of at least `min_confidence` in an RGB image `(H, W, 3)`, best first.

        Raises:
            Unavailable: onnxruntime failed, or the outputs are not those of an RF-DETR model.
        """
        try:
            boxes, logits = self._session.run(["dets", "labels"], {self._input.name: self._make_input(image)})
        except Exception as error:
            raise Unavailable(f"onnxruntime failed: {_shorten(error)}") from error
        query_count = max(boxes.size // 4, 1)
        shapes = ((1, query_count, 4), (1, query_count, len(self.labels) + 1))
        if (boxes.shape, logits.shape) != shapes or np.isnan(boxes).any() or np.isnan(logits).any():
            returned = f"dets {boxes.shape} and labels {logits.shape}"
            raise Unavailable(f"the model returned NaN, or {returned} instead of {shapes[0]} and {shapes[1]}")
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

    def _make_input(self, image: NDArray[np.uint8]) -> NDArray[np.floating]:
        """Return the normalized image `(1, 3, H, W)` of the model's type."""
        size = self.input_size
        if image.shape[1::-1] != size:
            # Area averaging uses all pixels and does not move edges; bilinear resizing would skip pixels.
            is_larger = image.shape[1] > size[0] and image.shape[0] > size[1]
            interpolation = cv2.INTER_AREA if is_larger else cv2.INTER_LINEAR
            image = np.asarray(cv2.resize(image, size, interpolation=interpolation), dtype=np.uint8)
        normalized = (image.astype(np.float32) / 255 - CHANNEL_MEAN) / CHANNEL_STD
        return np.ascontiguousarray(normalized.transpose(2, 0, 1)[None], dtype=INPUT_TYPES[self._input.type])

    def _check_signature(self, path: Path) -> None:
        """Check names, types and shapes of inputs and outputs; a variable size is a name or None."""
        inputs = self._session.get_inputs()
        outputs = self._session.get_outputs()
        shapes = {node.name: node.shape for node in outputs}
        label_shape = shapes.get("labels", [])
        image_shapes = [node.shape for node in inputs if node.type in INPUT_TYPES and node.shape[1:-2] == [3]]
        # The batch may be of variable size.
        batch_sizes = [shape[0] if isinstance(shape[0], int) else 1 for shape in image_shapes]
        if len(inputs) != 1 or batch_sizes != [1] or "dets" not in shapes or len(label_shape) != 3:
            nodes = ", ".join(f"{node.name} {node.type} {node.shape}" for node in (*inputs, *outputs))
            raise InputError(
                f"{path} is no RF-DETR for one RGB image: it has {nodes}, but needs float or float16 "
                f"[1, 3, H, W], dets [1, Q, 4], labels [1, Q, C+1]; export it with rfdetr"
            )
        if not all(isinstance(size, int) for size in (*inputs[0].shape[2:], label_shape[2])):
            raise InputError(f"{path} has an input or output of variable size; export it with fixed sizes")
        class_count = label_shape[2] - 1
        if class_count != len(self.labels):
            raise InputError(
                f"{path} has {class_count} classes, but there are {len(self.labels)} labels: "
                f"{', '.join(self.labels)}; give one label per class, in the order of the model"
            )


def _shorten(error: Exception) -> str:
    """Return the message of onnxruntime as one line, without error code, C++ file and C++ function."""
    return " ".join(re.sub(r"^\[\w+\] : \d+ : \w+ : |/\S+:\d+ [^(]*\([^)]*\) ", "", str(error)).split())


def _explain_load_error(path: Path, error: Exception) -> str:
    content = path.read_bytes() if path.is_file() else b""
    if content.startswith(b"version https://git-lfs"):
        return "it is a pointer of Git LFS; fetch the file with `git lfs pull`"
    if re.match(rb"\s*<(!doctype|html)", content, re.IGNORECASE):
        return "it is a web page; download the file itself"
    return f"{_shorten(error).rstrip('.')}; export or download it again"


@functools.lru_cache(maxsize=4)
def _load_model(path: Path, labels: tuple[str, ...], threads: int, _change_time: int) -> OnnxModel:
    """Return the model in a file; `_change_time` distinguishes versions of a file.

    Unchanged models are loaded once per process, because a worker of a sweep runs a mission many times, and
    loading takes 0.2 s.
    """
    return OnnxModel(path, labels, threads)


@functools.lru_cache(maxsize=4)
def find_model_errors(path: Path, labels: tuple[str, ...], _change_time: int) -> list[str]:
    """Return messages about what is wrong with a model; `_change_time` distinguishes versions of a file.

    The model is loaded and run on an empty image in a child process, because it may crash or never end.
    """
    command = build_command("executive.perception.detectors.rfdetr", str(path), *labels)
    try:
        trial = subprocess.run(command, capture_output=True, text=True, check=True, timeout=TRIAL_TIMEOUT)
    except (OSError, ValueError, subprocess.SubprocessError):
        return [f"{path} crashes, or takes over {TRIAL_TIMEOUT:.0f} s for an empty image; export it again"]
    return trial.stdout.splitlines()


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
        lines = read_file(path).decode().splitlines()
    except UnicodeDecodeError as error:
        raise InputError(f"the label file {path} cannot be read: {error}") from error
    names = tuple(line.strip() for line in lines if line.strip())
    if not names:
        raise InputError(f"the label file {path} is empty; it needs one class name per line")
    return names


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


@dataclass(frozen=True, eq=False)
class RfdetrDetector:
    """Detector that runs an exported RF-DETR model, an ONNX file.

    Attributes:
        model: The model.
        config: Section of the detector in the cell file.
        context: Parts of the cell that the detector uses.
        class_map: Class names of the cell by class names of the model, if the names differ.
    """

    model: OnnxModel
    config: DetectorConfig
    context: DetectorContext
    class_map: Mapping[str, str]

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
        path = folder / options.model_path
        change_time = path.stat().st_mtime_ns if path.is_file() else 0
        model = _load_model(path, options.read_names(folder), options.threads, change_time)
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
        errors = list(options.find_class_map_errors(config, options.class_map, names))
        yield from errors
        if not errors and path.is_file() and not is_measured(path, base):
            for message in find_model_errors(path, names, path.stat().st_mtime_ns):
                yield "model_path", message

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

    def detect(self, frame: Frame, view: str) -> list[Detection]:
        """Search the regions of a view, and merge the detections."""
        height, width = frame.image.shape[:2]
        regions = list_regions(view, self.context.camera.table_view, (width, height))
        detect = partial(self.model.detect, min_confidence=self.config.floor)
        return search_regions(frame.image, regions, detect, self.class_map)


class EmbeddedDetector(RfdetrDetector):
    """Detector of cubes, spheres and ducks with shipped weights (model card: `weights/embedded.card.md`)."""

    @staticmethod
    def check(config: DetectorConfig, base: Path, all_configs: Mapping[str, DetectorConfig]) -> OptionErrors:
        """Yield each option in the cell file with an error message: this kind of detector has no options."""
        del base, all_configs
        yield from DetectorOptions.find_errors(config)

    @staticmethod
    def _read_options(config: DetectorConfig) -> RfdetrOptions:
        del config
        return RfdetrOptions(model_path=str(MODEL_PATH), labels=str(LABELS_PATH))


def _try_model() -> None:
    """Run the model of the command line on an empty image, and print the error message, if any."""
    try:
        model = OnnxModel(Path(sys.argv[1]), sys.argv[2:])
        model.detect(np.zeros((*model.input_size, 3), np.uint8), min_confidence=1.0)
    except (InputError, Unavailable) as error:
        sys.stdout.write(str(error))


if __name__ == "__main__":
    _try_model()
