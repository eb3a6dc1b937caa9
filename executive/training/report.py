"""Callback that reports the progress of a training."""

from __future__ import annotations

from typing import Any

from pytorch_lightning import Callback

from executive.training.train import ReportBatch, ReportEpoch


class Report(Callback):
    """Calls a function after each epoch, and another function after each batch."""

    def __init__(self, report_epoch: ReportEpoch, report_batch: ReportBatch) -> None:
        self._report_epoch, self._report_batch = report_epoch, report_batch

    def on_train_batch_end(
        self, trainer: Any, pl_module: Any, outputs: Any, batch: Any, batch_idx: int
    ) -> None:
        """Report the number of finished batches and of all batches."""
        del pl_module, outputs, batch
        size = trainer.num_training_batches
        self._report_batch(trainer.current_epoch * size + batch_idx + 1, trainer.max_epochs * size)

    def on_train_epoch_end(self, trainer: Any, pl_module: Any) -> None:
        """Report the metrics of the epoch, those of the validation included."""
        del pl_module
        metrics = {name: float(value) for name, value in trainer.callback_metrics.items()}
        self._report_epoch(trainer.current_epoch + 1, metrics)
