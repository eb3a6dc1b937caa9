"""Training of the small RF-DETR on a COCO or YOLO dataset, and the card of the trained model."""

from __future__ import annotations

import contextlib
import csv
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from jinja2 import Environment, StrictUndefined

from executive.errors import InputError
from executive.perception.detectors.rfdetr import read_labels
from executive.text.files import read_image_header
from executive.training import dataset, evaluate
from executive.training.dataset import DatasetEntry
from executive.training.evaluate import MODEL_NAME, EvaluatedDetector
from executive.training.metrics import Evaluation
from executive.training.samples import LabelledDataset

CARD_THRESHOLD = 0.5
"""Minimum confidence of the detections for precision and recall in a model card."""
NEW_MODEL_LEARNING_RATE = 3e-4
"""Default learning rate of random weights, and of a start model with other classes."""
FINE_TUNING_LEARNING_RATE = 1e-4
"""Default learning rate of a start model with equal classes, small enough to preserve the weights."""

EPOCH_COLUMNS = {
    "train/loss": "loss",
    "val/mAP_50": "mAP50",
    "val/mAP_50_95": "mAP50-95",
    "val/precision": "precision",
    "val/recall": "recall",
}
"""Headings in a model card, by column of the trainer's `metrics.csv`."""


def train(
    splits: Mapping[str, LabelledDataset], out: Path, *, start_model: Path | None = None,
    learning_rate: float | None = None, epochs: int = 20, seed: int = 0,
    report_epoch: Callable[[int, dict[str, float]], None] = lambda _number, _metrics: None,
    report_batch: Callable[[int, int], None] = lambda _finished_count, _total_count: None,
) -> None:  # fmt: skip
    """Train a model and write it to `out`.

    Files in `out`: `model.onnx` and `labels.txt` for a detector of kind `rfdetr`; `card.md` with the accuracy
    on the validation images; `checkpoint_best_total.pth` with weights that can be trained further;
    `metrics.csv` with the metrics of each epoch.

    Args:
        splits: The splits `train` and `valid` of a dataset, from `load_dataset`.
        out: Output folder, which is created if it is missing.
        start_model: Checkpoint (`.pth`) or exported model (`.onnx`) of this architecture to fine-tune, which
            may have other classes; None: training starts from random weights.
        learning_rate: Learning rate; None: 1e-4 if `start_model` has the same classes, else 3e-4.
        epochs: Number of passes over the dataset.
        seed: Seed of the initial weights, of the order of the images, and of the augmentation.
        report_epoch: Called after each epoch with its number, from 1, and its metrics by name.
        report_batch: Called after each batch with the numbers of finished and of all batches.

    Raises:
        InputError: An image is damaged, `start_model` does not exist, or the training packages are not
            installed.
    """
    if start_model is not None and not start_model.is_file():
        raise InputError(f"there is no model {start_model} to start from; train one first, or omit --from")
    try:
        from executive.training.model import describe_architecture, export_onnx, fit_model
    except ImportError as error:
        advice = "install the extra, about 3 GB to download on Linux: uv sync --extra train"
        raise InputError(f'training needs the package "{error.name}"; {advice}') from error
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out) as folder:
        labels = write_coco_dataset(splits, Path(folder))
        fit_model(
            Path(folder), out, labels, start_model=start_model, epochs=epochs, seed=seed,
            learning_rate=learning_rate or choose_learning_rate(start_model, labels),
            report_epoch=report_epoch, report_batch=report_batch,
        )  # fmt: skip
    model = out / "model.onnx"
    export_onnx(out / "checkpoint_best_total.pth", len(labels), model)
    config = evaluate.make_model_config(model, out / "labels.txt")
    with contextlib.closing(EvaluatedDetector({MODEL_NAME: config}, MODEL_NAME, base=Path())) as detector:
        accuracy = evaluate.evaluate(detector, splits["valid"], threshold=CARD_THRESHOLD)
    card = render_card(
        title=f"Small RF-DETR trained on {splits['train'].folder.name}",
        summary=f"Detects {', '.join(labels)} in square images.",
        settings={
            **describe_architecture(),
            "start": "random weights" if start_model is None else start_model.name,
            **({} if learning_rate is None else {"learning rate": f"{learning_rate:g}"}),
            "epochs": str(epochs),
            "seed": str(seed),
            "weights stored as": "int8",
        },
        epochs=read_epochs(out / "metrics.csv"),
        accuracy=accuracy,
    )
    (out / "card.md").write_text(card, encoding="utf-8")


def choose_learning_rate(start_model: Path | None, labels: list[str]) -> float:
    """Return the default learning rate for training `start_model` on the classes `labels`."""
    if start_model is not None:
        file = evaluate.find_label_file(start_model)
        if file.is_file() and list(read_labels(file)) == labels:
            return FINE_TUNING_LEARNING_RATE
    return NEW_MODEL_LEARNING_RATE


def load_dataset(folder: Path) -> dict[str, LabelledDataset]:
    """Return the splits `train` and `valid` of a dataset; the classes of `valid` are spelled as in `train`.

    Raises:
        InputError: A split is missing, empty or damaged.
    """
    splits = {split: LabelledDataset(folder, split) for split in ("train", "valid")}
    splits["valid"].match_classes(splits["train"].classes, "the split train")
    return splits


def write_coco_dataset(splits: Mapping[str, LabelledDataset], folder: Path) -> list[str]:
    """Write splits as a COCO dataset with the boxes and pixels that an evaluation sees; return the classes.

    The COCO files contain absolute paths of the images that RF-DETR decodes like `read_image`. Other images
    are converted, for instance because RF-DETR ignores the EXIF orientation.
    """
    entries = []
    classes = list(dict.fromkeys([*splits["train"].classes, *splits["valid"].object_counts]))
    for split, images in splits.items():
        for index, (path, entry) in enumerate(images.annotations.items()):
            _, is_plain = read_image_header(path)
            file = path.absolute()
            if not is_plain:
                file = dataset.build_image_path(folder, "coco", split, f"{index}.png")
                dataset.save_image(file, dataset.read_image(path))
            entries.append(DatasetEntry(split, str(file), entry.size, entry.labels, entry.boxes))
    dataset.write_annotations(folder, "coco", entries, classes)
    return classes


def render_card(
    title: str, summary: str, settings: Mapping[str, str], epochs: Sequence[Mapping[str, float]],
    accuracy: Evaluation,
) -> str:  # fmt: skip
    """Return the card of a model as Markdown; its template is `model_card.md.jinja`.

    Args:
        title: Name of the model.
        summary: Purpose of the model, one or two sentences.
        settings: Settings of the training by name.
        epochs: Metrics of each epoch, by the keys of `EPOCH_COLUMNS`.
        accuracy: Evaluation of the model on the validation images.
    """
    template = Path(__file__).with_name("model_card.md.jinja").read_text(encoding="utf-8")
    environment = Environment(
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True, undefined=StrictUndefined
    )
    values = {"title": title, "summary": summary, "settings": settings, "epochs": epochs}
    return environment.from_string(template).render(values, accuracy=accuracy, columns=EPOCH_COLUMNS)


def read_epochs(metrics_file: Path) -> list[dict[str, float]]:
    """Return the metrics of every epoch from a `metrics.csv`, which has several rows per epoch."""
    epochs: dict[int, dict[str, float]] = {}
    with metrics_file.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            epoch = epochs.setdefault(int(row["epoch"]), {})
            epoch.update({name: float(row[name]) for name in EPOCH_COLUMNS if row.get(name)})
    return [epochs[number] for number in sorted(epochs)]
