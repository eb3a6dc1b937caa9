"""`executive train`: train the small detector."""

from __future__ import annotations

from pathlib import Path

import click

from executive.cli.options import COUNT, FILE, FOLDER, seed_option
from executive.cli.output import stdout_kept_clean


@click.command(name="train")
@click.option(
    "--dataset", type=FOLDER, required=True,
    help="COCO or YOLO folder, from `executive dataset` or a Roboflow export.",
)  # fmt: skip
@click.option("--out", type=FOLDER, required=True, help="Folder for checkpoints and figures.")
@click.option(
    "--from", "start", type=FILE, metavar="MODEL",
    help="Model of an earlier training to fine-tune, .onnx or .pth; without it, random weights.",
)  # fmt: skip
@click.option(
    "--rate", type=click.FloatRange(min=0, min_open=True),
    help="Learning rate; by default 1e-4 for a model that knows the same classes, else 3e-4.",
)  # fmt: skip
@click.option("--epochs", type=COUNT, default=20, help="Passes over it.")
@seed_option
def command(dataset: Path, out: Path, start: Path | None, rate: float | None, epochs: int, seed: int) -> None:
    """Train the small RF-DETR; needs the extra `train`."""
    with stdout_kept_clean():
        from executive.cli.progress import bar, report_polygons
        from executive.vision.train import train
        from executive.vision.training.settings import Settings

        report_polygons(dataset / "train")
        with bar("training") as batches:
            train(dataset, out, Settings(start, rate, epochs, seed), _tell, batches)


def _tell(epoch: int, metrics: dict[str, float]) -> None:
    """Print the figures of an epoch."""
    figures = ", ".join(f"{name} {value:.4g}" for name, value in metrics.items())
    click.echo(f"epoch {epoch}: {figures}", err=True)
