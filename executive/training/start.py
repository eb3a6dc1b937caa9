"""Learning rate of a training, which depends on the weights that it starts from."""

from __future__ import annotations

from pathlib import Path

from executive.perception.detectors.onnx_model import read_labels

LEARNING_RATE = 3e-4
"""Rate from random weights, or from those that know other objects."""
FINE_TUNING_RATE = 1e-4
"""Rate from weights that are good already; larger steps would first undo them."""


def learning_rate(start: Path | None, labels: list[str]) -> float:
    """Return the rate for learning `labels` from a model, whose own labels lie beside it.

    The file is called `labels.txt`, or `NAME.labels.txt` beside a model `NAME.onnx`.
    """
    if start is None:
        return LEARNING_RATE
    files = (start.with_suffix(".labels.txt"), start.with_name("labels.txt"))
    beside = next((file for file in files if file.is_file()), None)
    is_known = beside is not None and list(read_labels(beside)) == labels
    return FINE_TUNING_RATE if is_known else LEARNING_RATE
