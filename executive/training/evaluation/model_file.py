"""Measuring a model file that no cell names yet."""

from __future__ import annotations

import contextlib
from pathlib import Path

from executive.cell.config import DetectorConfig
from executive.training.evaluation.asking import CellDetector
from executive.training.evaluation.evaluate import evaluate
from executive.training.evaluation.figures import Evaluation
from executive.training.samples import Samples

FLOOR = 0.01
"""Confidence from which boxes of a model file count for the mean average precision."""
MODEL_NAME = "model"
"""What such a detector is called."""


def model_detector(model: Path, labels: Path) -> DetectorConfig:
    """Return the section of a cell file for an exported RF-DETR.

    Args:
        model: The ONNX file.
        labels: The text file that lists its class names.
    """
    files = {"model_path": str(model.absolute()), "labels": str(labels.absolute())}
    return DetectorConfig.model_validate({"kind": "rfdetr", "floor": FLOOR, **files})


def evaluate_folder(model: Path, labels: Path, folder: Path, threshold: float) -> Evaluation:
    """Return how good an exported RF-DETR is on a folder of labelled images.

    Args:
        model: The ONNX file.
        labels: The text file that lists its class names.
        folder: A split, or a data set whose `test` or else `valid` split is used.
        threshold: Confidence from which a detection counts.

    Raises:
        InputError: Model, labels or images cannot be read.
    """
    detector = CellDetector({MODEL_NAME: model_detector(model, labels)}, MODEL_NAME, base=Path())
    with contextlib.closing(detector):
        return evaluate(detector, Samples(folder), threshold=threshold)
