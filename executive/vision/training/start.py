"""Learning rate of a training, by the weights that it starts from."""

from __future__ import annotations

from pathlib import Path

from executive.vision.detectors.onnx_model import read_labels

LEARNING_RATE = 3e-4
"""Rate from random weights, or from those that know other objects."""
FINE_TUNING_RATE = 1e-4
"""Rate from weights that are good already; larger steps would first undo them."""


def learning_rate(start: Path | None, labels: list[str]) -> float:
    """Return the rate for learning `labels` from a checkpoint, whose own `labels.txt` lies beside it."""
    if start is None or not (beside := start.with_name("labels.txt")).is_file():
        return LEARNING_RATE
    return FINE_TUNING_RATE if list(read_labels(beside)) == labels else LEARNING_RATE
