"""Fitting of the small RF-DETR with the trainer of RF-DETR."""

from __future__ import annotations

from pathlib import Path

import pytorch_lightning
import torch
from rfdetr import RFDETR
from rfdetr.training import build_trainer

from executive.training.architecture import create_model
from executive.training.lightning import MixedPrecisionModel, SymmetryAugmentedData
from executive.training.progress_reporter import ProgressReporter
from executive.training.restore import restore_model
from executive.training.train import ReportBatch, ReportEpoch, Settings, choose_learning_rate

BATCH_SIZE = 16
"""Number of images per batch."""
CPU_THREAD_COUNT = 2
"""Number of threads of torch if there is no GPU."""


def fit_model(
    dataset: Path, out: Path, settings: Settings, report_epoch: ReportEpoch, report_batch: ReportBatch
) -> None:
    """Train a model, and write checkpoints, `labels.txt` and `metrics.csv` to the folder `out`."""
    start_model = settings.start_model
    has_gpu = torch.cuda.is_available()
    if not has_gpu:
        torch.set_num_threads(CPU_THREAD_COUNT)
    pytorch_lightning.seed_everything(settings.seed, workers=True, verbose=False)
    # Exports of Roboflow contain a parent category, which rfdetr omits because the category is no class.
    labels = list(RFDETR._load_classes(str(dataset)))
    learning_rate = settings.learning_rate or choose_learning_rate(start_model, labels)
    if start_model is not None and start_model.suffix == ".onnx":
        start_model = _write_checkpoint(start_model, out)
    detector = create_model(len(labels), start_model, "cuda" if has_gpu else "cpu")
    config = detector.get_train_config(
        dataset_dir=str(dataset),
        output_dir=str(out),
        epochs=settings.epochs,
        batch_size=BATCH_SIZE,
        lr=learning_rate,
        # By default, the encoder has smaller learning rates, which would preserve pretrained weights.
        lr_encoder=learning_rate,
        lr_vit_layer_decay=1.0,
        lr_component_decay=1.0,
        lr_scheduler="cosine",
        warmup_epochs=0.5,
        # `last.ckpt` is overwritten in each epoch; one checkpoint per epoch would fill the disk.
        checkpoint_interval=settings.epochs + 1,
        use_ema=False,
        # Scaling and cropping would resample images, which moves objects by a fraction of a pixel.
        multi_scale=False,
        expanded_scales=False,
        scale_jitter=False,
        aug_config={},
        pack_targets=False,
        num_workers=0,
        tensorboard=False,
        seed=settings.seed,
    )
    model = MixedPrecisionModel(detector.model_config, config, is_mixed=not has_gpu and has_bfloat16())
    data = SymmetryAugmentedData(detector.model_config, config)
    trainer = build_trainer(config, detector.model_config, accelerator="gpu" if has_gpu else "cpu")
    trainer.callbacks.append(ProgressReporter(report_epoch, report_batch))
    trainer.fit(model, data)
    (out / "labels.txt").write_text("".join(f"{label}\n" for label in labels), encoding="utf-8")


def _write_checkpoint(model: Path, out: Path) -> Path:
    """Write the weights of an exported model as a checkpoint to the folder `out`; return its path."""
    path = out / "start.pth"
    torch.save({"model": restore_model(model).model.model.state_dict()}, path)
    return path


def has_bfloat16() -> bool:
    """Return True if this CPU multiplies bfloat16 matrices in hardware; an emulation would be slow."""
    capabilities = torch.cpu.get_capabilities()
    return bool(capabilities.get("avx512_bf16") or capabilities.get("amx_bf16"))
