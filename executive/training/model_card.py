"""Card of a trained model: its settings, its accuracy and the course of its training."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

from executive.training.evaluation.figures import Evaluation, Spread

EPOCH_COLUMNS = {
    "train/loss": "loss",
    "val/mAP_50": "mAP50",
    "val/mAP_50_95": "mAP50-95",
    "val/precision": "precision",
    "val/recall": "recall",
}
"""Columns of the trainer's `metrics.csv` that a card shows, with their headings."""

FIGURES = {
    "images": ("images", "{}"), "objects": ("objects", "{}"),
    "precision": ("precision", "{:.4f}"), "recall": ("recall", "{:.4f}"),
    "mAP50": ("map50", "{:.4f}"), "mAP50-95": ("map50_95", "{:.4f}"),
}  # fmt: skip
"""Figures of an evaluation that a card shows: heading, then name and format."""


def write_card(
    title: str,
    summary: str,
    settings: Mapping[str, str],
    epochs: Sequence[Mapping[str, float]],
    measured: Mapping[str, Evaluation],
) -> str:
    """Return the card of a model as Markdown.

    Args:
        title: Name of the model.
        summary: Purpose of the model, one or two sentences.
        settings: Settings of the training by name.
        epochs: Figures of each epoch, by the names of `EPOCH_COLUMNS`.
        measured: Measurements of the model by the name of the images.
    """
    blocks = [f"# {title}", summary, _table(("setting", "value"), list(settings.items()))]
    if measured:
        confidences = ", ".join(f"{one:g}" for one in sorted({one.threshold for one in measured.values()}))
        rows = [
            (
                where,
                *(form.format(getattr(one, name)) for name, form in FIGURES.values()),
                _spread(one.centre),
                _spread(one.position),
            )
            for where, one in measured.items()
        ]
        blocks += [
            "## Measured",
            f"Precision and recall at confidence {confidences} and an overlap of 0.5. Centre and position: "
            "how far the centre of a found box lies from the true one's, in the image and in the world at "
            "the object's height; median / 95 % / 99 %.",
            _table(("on", *FIGURES, "centre [px]", "position [mm]"), rows),
        ]
    if epochs:
        figures = [
            (str(number), *(f"{row[name]:.4f}" if name in row else "" for name in EPOCH_COLUMNS))
            for number, row in enumerate(epochs, 1)
        ]
        blocks += ["## Training", _table(("epoch", *EPOCH_COLUMNS.values()), figures)]
    return "\n\n".join(blocks) + "\n"


def read_epochs(metrics: Path) -> list[dict[str, float]]:
    """Return the figures of every epoch in a trainer's `metrics.csv`, which spreads one over several rows."""
    epochs: dict[int, dict[str, float]] = {}
    with metrics.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            figures = epochs.setdefault(int(row["epoch"]), {})
            figures.update({name: float(row[name]) for name in EPOCH_COLUMNS if row.get(name)})
    return [epochs[number] for number in sorted(epochs)]


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _spread(spread: Spread | None) -> str:
    return "" if spread is None else f"{spread.median:.2f} / {spread.p95:.2f} / {spread.p99:.2f}"
