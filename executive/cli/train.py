"""`executive train`: train the small RF-DETR on a dataset."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import click

from executive.cli.options import COUNT, FILE, FOLDER, seed_option
from executive.cli.streams import keep_stdout_clean


@click.command(name="train")
@click.option(
    "--dataset", type=FOLDER, required=True,
    help="COCO or YOLO dataset, from `executive dataset` or an export of an annotation tool.",
)  # fmt: skip
@click.option("--out", type=FOLDER, required=True, help="Folder for model, checkpoints and metrics.")
@click.option(
    "--from", "model", type=FILE, metavar="MODEL",
    help="Model file (.onnx or .pth) to fine-tune; by default, training starts from random weights.",
)  # fmt: skip
@click.option(
    "--rate", type=click.FloatRange(min=0, min_open=True),
    help="Learning rate; by default 1e-4 if --from is a model for the same classes, else 3e-4.",
)  # fmt: skip
@click.option("--epochs", type=COUNT, default=20, help="Number of passes over the dataset.")
@seed_option
def command(dataset: Path, out: Path, model: Path | None, rate: float | None, epochs: int, seed: int) -> None:
    """Train the small RF-DETR detector.

    Needs the extra `train`: uv sync --extra train (a download of about 3 GB on Linux).
    """
    with keep_stdout_clean():
        from executive.cli.progress import show_progress
        from executive.training.train import load_dataset, train

        splits = load_dataset(dataset)
        for images in splits.values():
            click.echo(images.summary, err=True)
        with show_progress("training") as progress:
            train(
                splits, out, start_model=model, learning_rate=rate, epochs=epochs, seed=seed,
                report_epoch=partial(_print_epoch, epochs), report_batch=progress,
            )  # fmt: skip
        click.echo(
            "add these lines to the cell file, with paths relative to the folder of the cell file:\n\n"
            "detectors:\n  trained:\n    kind: rfdetr\n"
            f"    model_path: {out / 'model.onnx'}\n    labels: {out / 'labels.txt'}",
            err=True,
        )


def _print_epoch(epoch_count: int, epoch: int, metrics: dict[str, float]) -> None:
    values = ", ".join(f"{name} {value:.4g}" for name, value in metrics.items())
    click.echo(f"epoch {epoch} of {epoch_count}: {values}", err=True)
