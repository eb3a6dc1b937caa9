"""What a training starts from: its weights, and how large steps they bear."""

from __future__ import annotations

from pathlib import Path

from executive.vision.detectors.onnx_model import read_labels
from executive.vision.training.recover import recover

LEARNING_RATE = 3e-4
"""From random weights, or from those that know other objects."""
FINE_TUNING_RATE = 1e-4
"""From weights that are good already, larger steps would first undo them."""


def checkpoint(start: Path | None, out: Path) -> Path | None:
    """Return a checkpoint with the weights of `start`, recovered into `out` where it is an exported model.

    Raises:
        InputError: It is a model of another architecture.
    """
    if start is None or start.suffix != ".onnx":
        return start
    recover(start, out / "start.pth")
    return out / "start.pth"


def learning_rate(start: Path | None, labels: list[str]) -> float:
    """Return how large steps are for learning `labels` from `start`, whose own labels lie beside it."""
    if start is None:
        return LEARNING_RATE
    beside = (start.with_name(f"{start.stem}.labels.txt"), start.with_name("labels.txt"))
    known = next((list(read_labels(path)) for path in beside if path.is_file()), [])
    return FINE_TUNING_RATE if known == labels else LEARNING_RATE
