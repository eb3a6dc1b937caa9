"""Fitting of the small RF-DETR with the trainer of RF-DETR.

The training images are augmented by symmetries of the square.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytorch_lightning
import torch
from lightning_utilities import apply_to_collection
from pytorch_lightning.callbacks import LambdaCallback
from rfdetr.training import RFDETRDataModule, RFDETRModelModule, build_trainer

from executive.training.model import create_model, restore_model

BATCH_SIZE = 16
"""Number of images per batch."""
CPU_THREAD_COUNT = 2
"""Number of threads of torch if there is no GPU."""
SYMMETRY_COUNT = 8
"""Number of symmetries of the square. Symmetry 2 k rotates by k quarter turns anticlockwise; symmetry 2 k + 1
first mirrors left to right, then rotates by k quarter turns."""


def fit_model(
    dataset: Path, out: Path, labels: Sequence[str], *, start_model: Path | None, learning_rate: float,
    epochs: int, seed: int, report_epoch: Callable[[int, dict[str, float]], None],
    report_batch: Callable[[int, int], None],
) -> None:  # fmt: skip
    """Train a model on a COCO dataset; write checkpoints, `labels.txt` and `metrics.csv` to `out`."""

    def report_batch_end(trainer: Any, _model: Any, _loss: Any, _batch: Any, batch_index: int) -> None:
        epoch_size = trainer.num_training_batches
        finished_count = trainer.current_epoch * epoch_size + batch_index + 1
        report_batch(finished_count, trainer.max_epochs * epoch_size)

    def report_epoch_end(trainer: Any, _model: Any) -> None:
        metrics = {name: float(value) for name, value in trainer.callback_metrics.items()}
        report_epoch(trainer.current_epoch + 1, metrics)

    has_gpu = torch.cuda.is_available()
    if not has_gpu:
        torch.set_num_threads(CPU_THREAD_COUNT)
    pytorch_lightning.seed_everything(seed, workers=True, verbose=False)
    if start_model is not None and start_model.suffix == ".onnx":
        weights = restore_model(start_model).model.model.state_dict()
        start_model = out / "start.pth"
        torch.save({"model": weights}, start_model)
    detector = create_model(len(labels), start_model, "cuda" if has_gpu else "cpu")
    config = detector.get_train_config(
        dataset_dir=str(dataset),
        output_dir=str(out),
        epochs=epochs,
        batch_size=BATCH_SIZE,
        lr=learning_rate,
        # By default, the encoder has smaller learning rates, which would preserve pretrained weights.
        lr_encoder=learning_rate,
        lr_vit_layer_decay=1.0,
        lr_component_decay=1.0,
        lr_scheduler="cosine",
        warmup_epochs=0.5,
        # `last.ckpt` is overwritten in each epoch; one checkpoint per epoch would fill the disk.
        checkpoint_interval=epochs + 1,
        use_ema=False,
        # Scaling and cropping would resample images, which moves objects by a fraction of a pixel.
        multi_scale=False,
        expanded_scales=False,
        scale_jitter=False,
        aug_config={},
        pack_targets=False,
        num_workers=0,
        tensorboard=False,
        seed=seed,
    )
    model = RFDETRModelModule(detector.model_config, config)
    # Reference boxes have the data type of the encoder's features; bfloat16 would round them to whole pixels.
    model.model.backbone[0].projector.register_forward_hook(
        lambda _module, _inputs, output: apply_to_collection(output, torch.Tensor, torch.Tensor.float)
    )
    data = SymmetryAugmentedData(detector.model_config, config)
    trainer = build_trainer(config, detector.model_config, accelerator="gpu" if has_gpu else "cpu")
    trainer.callbacks.append(
        LambdaCallback(on_train_batch_end=report_batch_end, on_train_epoch_end=report_epoch_end)
    )
    trainer.fit(model, data)
    (out / "labels.txt").write_text("".join(f"{label}\n" for label in labels), encoding="utf-8")


class SymmetryAugmentedData(RFDETRDataModule):
    """Dataset whose training images are transformed by random symmetries of the square.

    A camera that looks straight down can capture each transformed image. No pixel is resampled.
    """

    def on_after_batch_transfer(self, batch: tuple[Any, Any], dataloader_idx: int) -> tuple[Any, Any]:
        """Return a batch; during training, its images are rotated and mirrored at random."""
        samples, targets = super().on_after_batch_transfer(batch, dataloader_idx)
        if self.trainer is None or not self.trainer.training:
            return samples, targets
        symmetries = torch.randint(SYMMETRY_COUNT, (len(targets),)).tolist()
        for image, target, symmetry in zip(samples.tensors, targets, symmetries, strict=True):
            image.copy_(transform_image(image, symmetry))
            target["boxes"] = transform_boxes(target["boxes"], symmetry)
        return samples, targets


def transform_image(image: torch.Tensor, symmetry: int) -> torch.Tensor:
    """Return `image` `(..., N, N)`, transformed by the symmetry with the number `symmetry`, 0 to 7."""
    mirrored = image.flip(-1) if symmetry % 2 else image
    return mirrored.rot90(symmetry // 2, (-2, -1))


def transform_boxes(boxes: torch.Tensor, symmetry: int) -> torch.Tensor:
    """Return `boxes` `(N, 4)` (centre x and y, width, height; 0 to 1), transformed by a symmetry, 0 to 7."""
    x, y, width, height = boxes.unbind(-1)
    if symmetry % 2:
        x = 1 - x
    for _ in range(symmetry // 2):
        # A quarter turn anticlockwise moves the right edge of the image to the top.
        x, y, width, height = y, 1 - x, height, width
    return torch.stack((x, y, width, height), dim=-1)
