"""Callback of the trainer that reports the progress of a training."""

from __future__ import annotations

from typing import Any

from pytorch_lightning import Callback

from executive.training.train import ReportBatch, ReportEpoch


class ProgressReporter(Callback):
    """Calls `report_epoch` after each epoch and `report_batch` after each batch."""

    def __init__(self, report_epoch: ReportEpoch, report_batch: ReportBatch) -> None:
        self._report_epoch, self._report_batch = report_epoch, report_batch

    def on_train_batch_end(
        self, trainer: Any, pl_module: Any, outputs: Any, batch: Any, batch_idx: int
    ) -> None:
        """Report the number of finished batches and of all batches, over all epochs."""
        del pl_module, outputs, batch
        per_epoch = trainer.num_training_batches
        self._report_batch(trainer.current_epoch * per_epoch + batch_idx + 1, trainer.max_epochs * per_epoch)

    def on_train_epoch_end(self, trainer: Any, pl_module: Any) -> None:
        """Report the metrics of the epoch, including those on the validation images."""
        del pl_module
        metrics = {name: float(value) for name, value in trainer.callback_metrics.items()}
        self._report_epoch(trainer.current_epoch + 1, metrics)
