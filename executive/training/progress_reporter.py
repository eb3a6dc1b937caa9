"""Callback of the trainer that reports the progress of a training."""

from __future__ import annotations

from typing import Any

from pytorch_lightning import Callback

from executive.training.train import ReportBatch, ReportEpoch


class ProgressReporter(Callback):
    """Calls `report_epoch` after each epoch and `report_batch` after each batch."""

    def __init__(self, report_epoch: ReportEpoch, report_batch: ReportBatch) -> None:
        self._report_epoch, self._report_batch = report_epoch, report_batch

    def on_train_batch_end(self, trainer: Any, _model: Any, _loss: Any, _batch: Any, batch_idx: int) -> None:
        """Report the number of finished batches and the number of all batches, over all epochs."""
        epoch_size = trainer.num_training_batches
        finished_count = trainer.current_epoch * epoch_size + batch_idx + 1
        self._report_batch(finished_count, trainer.max_epochs * epoch_size)

    def on_train_epoch_end(self, trainer: Any, _model: Any) -> None:
        """Report the metrics of the epoch on the training images and on the validation images."""
        metrics = {name: float(value) for name, value in trainer.callback_metrics.items()}
        self._report_epoch(trainer.current_epoch + 1, metrics)
