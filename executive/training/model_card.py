"""Card of a trained model: settings, accuracy, and metrics of each epoch."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

from jinja2 import Environment, StrictUndefined

from executive.training.evaluation.metrics import Evaluation

EPOCH_COLUMNS = {
    "train/loss": "loss",
    "val/mAP_50": "mAP50",
    "val/mAP_50_95": "mAP50-95",
    "val/precision": "precision",
    "val/recall": "recall",
}
"""Headings in a model card, by column of the trainer's `metrics.csv`."""


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
