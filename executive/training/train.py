"""Train the small RF-DETR on a COCO or YOLO folder, from random weights or from a trained model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from executive.errors import InputError
from executive.perception.detectors.onnx_model import read_labels
from executive.training.annotations import read_annotations
from executive.training.evaluation.evaluate import evaluate_folder, label_file
from executive.training.model_card import read_epochs, write_card
from executive.training.samples import splits_of

ReportEpoch = Callable[[int, dict[str, float]], None]
"""Called after each epoch with its number, from 1, and its metrics by name."""
ReportBatch = Callable[[int, int], None]
"""Called after each batch with the number of finished batches and of all batches of all epochs."""

CARD_THRESHOLD = 0.5
"""Confidence at which the card states precision and recall."""
LEARNING_RATE = 3e-4
"""Learning rate from random weights, or from the weights of a model with other classes."""
FINE_TUNING_RATE = 1e-4
"""Learning rate from the weights of a model with the same classes; larger steps would first undo them."""


@dataclass(frozen=True)
class Settings:
    """Settings of a training that the user chooses.

    Attributes:
        start: Checkpoint (`.pth`) or exported model (`.onnx`) of this architecture to fine-tune, with any
            classes; a `labels.txt` beside it names them. None: training starts from random weights.
        rate: Learning rate; None: 1e-4 if `start` has the same classes, else 3e-4.
        epochs: Number of passes over the data.
        seed: Seed of weights, order and augmentation.
    """

    start: Path | None = None
    rate: float | None = None
    epochs: int = 20
    seed: int = 0


def train(
    dataset: Path,
    out: Path,
    settings: Settings,
    report_epoch: ReportEpoch = lambda _epoch, _metrics: None,
    report_batch: ReportBatch = lambda _done, _all: None,
) -> None:
    """Train a model and write it to `out`.

    A detector of kind `rfdetr` needs `model.onnx` and `labels.txt`. `card.md` states the accuracy on the
    validation images. A further training can start from `checkpoint_best_total.pth`. `metrics.csv` holds the
    metrics of each epoch.

    Args:
        dataset: Folder as Roboflow exports it: `train/` and `valid/`, each with `_annotations.coco.json`, or
            a `data.yaml` for YOLO.
        out: Output folder; created if missing.
        settings: Settings of the training.
        report_epoch: Called after each epoch.
        report_batch: Called after each batch.

    Raises:
        InputError: The folder is no data set, `start` does not exist, or the training packages are not
            installed.
    """
    start, rate = settings.start, settings.rate
    _check(dataset, start)
    try:
        from executive.training.architecture import declare_missing_operators, describe_architecture

        declare_missing_operators()
        from executive.training.compress import export_onnx
        from executive.training.run import fit
    except ImportError as error:
        raise InputError(
            f'training needs the package "{error.name}"; install the extra, about 3 GB to download on Linux: '
            "uv sync --extra train"
        ) from error
    out.mkdir(parents=True, exist_ok=True)
    fit(dataset, out, settings, report_epoch, report_batch)
    model, labels = out / "model.onnx", out / "labels.txt"
    export_onnx(out / "checkpoint_best_total.pth", len(read_labels(labels)), model)
    card = write_card(
        title=f"Small RF-DETR trained on {dataset.name}",
        summary=f"Finds {', '.join(read_labels(labels))} in square images.",
        settings={
            **describe_architecture(),
            "start": "random weights" if start is None else start.name,
            **({} if rate is None else {"learning rate": f"{rate:g}"}),
            "epochs": str(settings.epochs),
            "seed": str(settings.seed),
            "weights stored as": "int8",
        },
        epochs=read_epochs(out / "metrics.csv"),
        measured={"validation images": evaluate_folder(model, labels, _validation(dataset), CARD_THRESHOLD)},
    )
    (out / "card.md").write_text(card, encoding="utf-8")


def learning_rate(start: Path | None, labels: list[str]) -> float:
    """Return the learning rate for a training of `labels` from the model `start`.

    The labels of the model are in `labels.txt`, or in `NAME.labels.txt` for a model `NAME.onnx`.
    """
    if start is None:
        return LEARNING_RATE
    file = label_file(start)
    return FINE_TUNING_RATE if file.is_file() and list(read_labels(file)) == labels else LEARNING_RATE


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
    for split in splits_of(dataset):
        read_annotations(split)


def _validation(dataset: Path) -> Path:
    """Return the folder of the validation split; YOLO data sets call it `valid` or `val`."""
    return next(path for path in (dataset / "valid", dataset / "val", dataset) if path.is_dir())
