"""Telling how far a training is."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pytorch_lightning import Callback

Progress = Callable[[int, dict[str, float]], None]
"""`progress(epoch, metrics)`: called after every epoch, from 1."""
Batches = Callable[[int, int], None]
"""`batches(done, all)`: called after every batch, epochs counted together."""


class Report(Callback):
    """Tells a function about every epoch, and another one about every batch."""

    def __init__(self, progress: Progress, batches: Batches) -> None:
        self._progress = progress
        self._batches = batches

    def on_train_batch_end(
        self, trainer: Any, pl_module: Any, outputs: Any, batch: Any, batch_idx: int
    ) -> None:
        """Report how many batches of how many are done."""
        del pl_module, outputs, batch
        each = trainer.num_training_batches
        self._batches(trainer.current_epoch * each + batch_idx + 1, trainer.max_epochs * each)

    def on_train_epoch_end(self, trainer: Any, pl_module: Any) -> None:
        """Report the epoch's figures; validation has run by now."""
        del pl_module
        metrics = {name: float(value) for name, value in trainer.callback_metrics.items()}
        self._progress(trainer.current_epoch + 1, metrics)
