"""Settings of a training that the user chooses."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Settings:
    """How to train.

    Attributes:
        start: Checkpoint (`.pth`) or exported model (`.onnx`) of this architecture to fine-tune, whatever its
            classes; a `labels.txt` beside it names them. None trains from random weights.
        rate: Learning rate; by default 1e-4 if `start` has the same classes, else 3e-4.
        epochs: Number of passes over the data.
        seed: Seed of weights, order and augmentation.
    """

    start: Path | None = None
    rate: float | None = None
    epochs: int = 20
    seed: int = 0
