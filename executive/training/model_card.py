"""Card of a trained model: settings, accuracy, and metrics of each epoch."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

from executive.training.evaluation.metrics import Distribution, Evaluation

EPOCH_COLUMNS = {
    "train/loss": "loss",
    "val/mAP_50": "mAP50",
    "val/mAP_50_95": "mAP50-95",
    "val/precision": "precision",
    "val/recall": "recall",
}
"""Headings in a model card, by column of the trainer's `metrics.csv`."""

METRIC_COLUMNS = {
    "images": ("images", "{}"), "objects": ("objects", "{}"),
    "precision": ("precision", "{:.4f}"), "recall": ("recall", "{:.4f}"),
    "mAP50": ("map50", "{:.4f}"), "mAP50-95": ("map50_95", "{:.4f}"),
}  # fmt: skip
"""Attribute of `Evaluation` and number format of each metric, by heading in a model card."""


def render_card(
    title: str, summary: str, settings: Mapping[str, str], epochs: Sequence[Mapping[str, float]],
    evaluations: Mapping[str, Evaluation],
) -> str:  # fmt: skip
    """Return the card of a model as Markdown.

    Args:
        title: Name of the model.
        summary: Purpose of the model, one or two sentences.
        settings: Settings of the training by name.
        epochs: Metrics of each epoch, by the keys of `EPOCH_COLUMNS`.
        evaluations: Evaluations of the model by the name of the dataset.
    """
    blocks = [f"# {title}", summary, _render_table(("setting", "value"), list(settings.items()))]
    if evaluations:
        thresholds = sorted({evaluation.threshold for evaluation in evaluations.values()})
        rows = []
        for dataset, evaluation in evaluations.items():
            metrics = [pattern.format(getattr(evaluation, name)) for name, pattern in METRIC_COLUMNS.values()]
            errors = [_format_distribution(values) for values in (evaluation.centre, evaluation.position)]
            rows.append([dataset, *metrics, *errors])
        blocks += [
            "## Accuracy",
            f"Precision and recall at confidence {', '.join(map('{:g}'.format, thresholds))} and IoU 0.5. "
            "Centre: distance between the centres of the detected and the true box in the image. Position: "
            "this distance in the world at the height of the object. Both: median / 95 % / 99 % quantile.",
            _render_table(("dataset", *METRIC_COLUMNS, "centre [px]", "position [mm]"), rows),
        ]
    if epochs:
        epoch_rows = [
            (str(number), *(f"{epoch[name]:.4f}" if name in epoch else "" for name in EPOCH_COLUMNS))
            for number, epoch in enumerate(epochs, 1)
        ]
        blocks += ["## Training", _render_table(("epoch", *EPOCH_COLUMNS.values()), epoch_rows)]
    return "\n\n".join(blocks) + "\n"


def read_epochs(metrics_file: Path) -> list[dict[str, float]]:
    """Return the metrics of every epoch from a `metrics.csv`, which has several rows per epoch."""
    epochs: dict[int, dict[str, float]] = {}
    with metrics_file.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            epoch = epochs.setdefault(int(row["epoch"]), {})
            epoch.update({name: float(row[name]) for name in EPOCH_COLUMNS if row.get(name)})
    return [epochs[number] for number in sorted(epochs)]


def _render_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table with a row of headings, followed by `rows`."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def _format_distribution(errors: Distribution | None) -> str:
    """Return the text of median, 95th and 99th percentile, or "" if there is no distribution."""
    return "" if errors is None else f"{errors.median:.2f} / {errors.p95:.2f} / {errors.p99:.2f}"
