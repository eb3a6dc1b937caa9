"""Training run: RF-DETR's trainer with the data, model and settings of this project."""

from __future__ import annotations

from pathlib import Path

import pytorch_lightning
import torch
from rfdetr.training import build_trainer

from executive.training.architecture import create_model
from executive.training.lightning import Model, SymmetricData
from executive.training.report import Report
from executive.training.restore import restore
from executive.training.train import ReportBatch, ReportEpoch, Settings, learning_rate

BATCH_SIZE = 16
CPU_THREADS = 2


def fit(
    dataset: Path, out: Path, settings: Settings, report_epoch: ReportEpoch, report_batch: ReportBatch
) -> None:
    """Train and write checkpoints, `labels.txt` and `metrics.csv` to `out`."""
    start = settings.start
    cuda = torch.cuda.is_available()
    if not cuda:
        torch.set_num_threads(CPU_THREADS)
    pytorch_lightning.seed_everything(settings.seed, workers=True, verbose=False)
    labels = class_names(dataset)
    rate = settings.rate or learning_rate(start, labels)
    if start is not None and start.suffix == ".onnx":
        start = _as_checkpoint(start, out)
    detector = create_model(len(labels), start, "cuda" if cuda else "cpu")
    config = detector.get_train_config(
        dataset_dir=str(dataset),
        output_dir=str(out),
        epochs=settings.epochs,
        batch_size=BATCH_SIZE,
        lr=rate,
        # By default, the encoder learns more slowly to keep its pretrained weights; here it has none.
        lr_encoder=rate,
        lr_vit_layer_decay=1.0,
        lr_component_decay=1.0,
        lr_scheduler="cosine",
        warmup_epochs=0.5,
        # `last.ckpt` is overwritten in each epoch; one checkpoint per epoch would fill the disk.
        checkpoint_interval=settings.epochs + 1,
        use_ema=False,
        # Resampling and crops would move boxes by a fraction of a pixel.
        multi_scale=False,
        expanded_scales=False,
        scale_jitter=False,
        aug_config={},
        pack_targets=False,
        num_workers=0,
        tensorboard=False,
        seed=settings.seed,
    )
    model = Model(detector.model_config, config, reduced=not cuda and has_bfloat16())
    data = SymmetricData(detector.model_config, config)
    trainer = build_trainer(config, detector.model_config, accelerator="gpu" if cuda else "cpu")
    trainer.callbacks.append(Report(report_epoch, report_batch))
    trainer.fit(model, data)
    (out / "labels.txt").write_text("".join(f"{label}\n" for label in labels), encoding="utf-8")


def _as_checkpoint(model: Path, out: Path) -> Path:
    """Write the weights of an exported model as a checkpoint into `out` and return its path."""
    path = out / "start.pth"
    torch.save({"model": restore(model).model.model.state_dict()}, path)
    return path


def class_names(dataset: Path) -> list[str]:
    """Return the classes of a COCO or YOLO folder in the order of the model's outputs."""
    from rfdetr import RFDETR

    # Roboflow's exports contain a parent category that is no class; rfdetr's training drops it, too.
    return list(RFDETR._load_classes(str(dataset)))


def has_bfloat16() -> bool:
    """Return True if this CPU multiplies bfloat16 matrices in hardware; the emulation is slow."""
    capabilities = torch.cpu.get_capabilities()
    return bool(capabilities.get("avx512_bf16") or capabilities.get("amx_bf16"))
