"""Train the small RF-DETR on a COCO or YOLO folder, from random weights or from a trained model."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from executive.errors import InputError
from executive.perception.detectors.onnx_model import read_labels
from executive.training.annotations import is_split, read_annotations
from executive.training.evaluation.model_file import evaluate_folder
from executive.training.model_card import ModelCard, read_epochs
from executive.training.samples import SPLITS
from executive.training.settings import Settings

Progress = Callable[[int, dict[str, float]], None]
Batches = Callable[[int, int], None]

CARD_THRESHOLD = 0.5
"""Confidence at which the card states precision and recall."""


def train(
    dataset: Path,
    out: Path,
    settings: Settings,
    progress: Progress = lambda _epoch, _metrics: None,
    batches: Batches = lambda _done, _all: None,
) -> None:
    """Leave a trained model in `out`.

    `model.onnx` and `labels.txt` are what a detector of kind `rfdetr` needs, `card.md` says how good it
    is on the validation images; `checkpoint_best_total.pth` is what a further training can start from,
    `metrics.csv` the course of this one.

    Args:
        dataset: Folder as Roboflow exports it: `train/` and `valid/`, each with `_annotations.coco.json`, or
            a `data.yaml` for YOLO.
        out: Folder to fill; made if missing.
        settings: How to train.
        progress: Called after every epoch with its number, from 1, and its figures.
        batches: Called after every batch with how many of how many are done, all epochs together.

    Raises:
        InputError: The folder is no data set, `start` is missing or no checkpoint, or the training packages
            are not installed.
    """
    start, rate = settings.start, settings.rate
    _check(dataset, start)
    try:
        from executive.training.torchvision_ops import declare_missing

        declare_missing()
        from executive.training.architecture import describe
        from executive.training.export import export_onnx
        from executive.training.run import fit
    except ImportError as error:
        raise InputError(
            f'training needs the package "{error.name}"; install the extra, about 3 GB to download on Linux: '
            "uv sync --extra train"
        ) from error
    out.mkdir(parents=True, exist_ok=True)
    fit(dataset, out, settings, progress, batches)
    model, labels = out / "model.onnx", out / "labels.txt"
    export_onnx(out / "checkpoint_best_total.pth", len(read_labels(labels)), model)
    card = ModelCard(
        title=f"Small RF-DETR trained on {dataset.name}",
        summary=f"Finds {', '.join(read_labels(labels))} in square images.",
        settings={
            **describe(),
            "start": "random weights" if start is None else start.name,
            **({} if rate is None else {"learning rate": f"{rate:g}"}),
            "epochs": str(settings.epochs),
            "seed": str(settings.seed),
            "weights stored as": "int8",
        },
        epochs=read_epochs(out / "metrics.csv"),
        measured={"validation images": evaluate_folder(model, labels, _validation(dataset), CARD_THRESHOLD)},
    )
    (out / "card.md").write_text(card.text(), encoding="utf-8")


def _check(dataset: Path, start: Path | None) -> None:
    if start is not None and not start.is_file():
        raise InputError(f"there is no checkpoint {start} to start from; train one first, or leave it out")
    coco = [dataset / part / "_annotations.coco.json" for part in ("train", "valid")]
    yolo = [dataset / name for name in ("data.yaml", "data.yml")]
    if not (all(path.is_file() for path in coco) or any(path.is_file() for path in yolo)):
        raise InputError(
            f"{dataset} is not a data set: it needs train/_annotations.coco.json and "
            "valid/_annotations.coco.json (COCO), or data.yaml (YOLO); a Roboflow export has one of them"
        )
    for split in (dataset / name for name in SPLITS):
        if is_split(split):
            read_annotations(split)


def _validation(dataset: Path) -> Path:
    """Return the split that is looked at between epochs; YOLO folders call it `valid` or `val`."""
    return next(path for path in (dataset / "valid", dataset / "val", dataset) if path.is_dir())
