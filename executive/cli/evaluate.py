"""`executive evaluate`: measure how good a detector is."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from executive.cli.options import json_option, seed_option
from executive.cli.output import print_json, stdout_kept_clean

if TYPE_CHECKING:
    from executive.vision.evaluate import Evaluation


@click.command(name="evaluate")
@click.option(
    "--cell", "cells", metavar="CELL", multiple=True, help="Cell to render fresh scenes of; repeatable."
)
@click.option(
    "--dataset", type=click.Path(path_type=Path, file_okay=False), metavar="FOLDER",
    help="COCO or YOLO folder of labelled images, instead of or beside cells.",
)  # fmt: skip
@click.option(
    "--weights", type=click.Path(path_type=Path, dir_okay=False), metavar="ONNX",
    help="Exported RF-DETR; without it, the detector that ships with this project.",
)  # fmt: skip
@click.option(
    "--labels", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE",
    help="Its class names, one a line; without it, labels.txt or NAME.labels.txt beside it.",
)  # fmt: skip
@click.option(
    "--images", type=click.IntRange(min=1), default=200, show_default=True, help="Scenes to render of a cell."
)
@seed_option
@click.option(
    "--threshold", type=click.FloatRange(0, 1), default=0.5, show_default=True,
    help="Confidence from which a detection counts.",
)  # fmt: skip
@click.option(
    "--as-run", is_flag=True,
    help="Scenes as a run begins with, instead of ones varied as widely as in training.",
)  # fmt: skip
@click.option("--workers", type=click.IntRange(min=1), default=2, show_default=True, help="Processes.")
@json_option
def command(
    cells: tuple[str, ...],
    dataset: Path | None,
    weights: Path | None,
    labels: Path | None,
    images: int,
    seed: int,
    threshold: float,
    as_run: bool,
    workers: int,
    as_json: bool,
) -> None:
    """Measure a detector on fresh scenes of cells, on labelled images, or on both."""
    if not cells and dataset is None:
        cells = ("overhead",)
    with stdout_kept_clean():
        from executive.cli.cells import load_cells
        from executive.cli.progress import bar
        from executive.sim.datasets import generate
        from executive.vision.detectors.embedded import LABELS, MODEL
        from executive.vision.evaluate import evaluate_folder

        model = weights or MODEL
        names = labels or (LABELS if weights is None else _labels_beside(weights))
        measured: dict[str, Evaluation] = {}
        for cell, config in load_cells(cells).items():
            with tempfile.TemporaryDirectory() as folder, bar(f"rendering {cell}") as progress:
                generate(
                    {cell: config}, Path(folder), images=images, seed=seed, layout="coco", workers=workers,
                    valid=1.0, progress=progress, randomized=not as_run,
                )  # fmt: skip
                measured[cell] = evaluate_folder(model, names, Path(folder), threshold)
        if dataset is not None:
            measured[str(dataset)] = evaluate_folder(model, names, dataset, threshold)
        for where, evaluation in measured.items():
            click.echo(f"{where}\n{_text(evaluation)}", err=True)
    if as_json:
        figures: dict[str, Any] = {where: evaluation.as_dict() for where, evaluation in measured.items()}
        print_json({"weights": str(model), "seed": seed, "measured": figures})


def _labels_beside(weights: Path) -> Path:
    """Return the label file that belongs to a model; the first that exists, or else the usual one."""
    usual = weights.with_name("labels.txt")
    own = weights.with_name(f"{weights.stem}.labels.txt")
    return own if own.is_file() else usual


def _text(evaluation: Evaluation) -> str:
    by_class = ", ".join(f"{label} {recall:.2%}" for label, recall in evaluation.recall_by_class.items())
    lines = [
        f"  {evaluation.objects} objects on {evaluation.images} images, threshold {evaluation.threshold:g}",
        f"  precision {evaluation.precision:.2%}, recall {evaluation.recall:.2%} ({by_class})",
        f"  mAP50 {evaluation.map50:.4f}, mAP50-95 {evaluation.map50_95:.4f}",
    ]
    for what, spread, unit in (
        ("centre off by", evaluation.centre, "px"),
        ("position off by", evaluation.position, "mm"),
        ("takes", evaluation.latency, "ms"),
    ):
        if spread is not None:
            lines.append(
                f"  {what} {spread.median:.2f} {unit} (median), {spread.p95:.2f} (95 %), "
                f"{spread.worst:.2f} (worst)"
            )
    return "\n".join(lines)
