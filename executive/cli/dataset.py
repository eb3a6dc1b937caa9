"""`executive dataset`: render labelled images of random scenes of cells."""

from __future__ import annotations

from pathlib import Path

import click

from executive.cli.options import COUNT, FOLDER, seed_option, workers_option
from executive.cli.streams import keep_stdout_clean


@click.command(name="dataset")
@click.argument("cells", metavar="CELL...", nargs=-1, required=True)
@click.option("--out", type=FOLDER, required=True, help="Folder of the dataset.")
@click.option("--images", type=COUNT, default=1000, help="Number of images.")
@seed_option
@click.option(
    "--format", "dataset_format", type=click.Choice(["coco", "yolo"]), default="coco",
    help="Format of the dataset: COCO or YOLO, as exported by Roboflow.",
)  # fmt: skip
@workers_option
@click.option("--valid", type=click.FloatRange(0, 1), default=0.1, help="Fraction of images for validation.")
def command(
    cells: tuple[str, ...], out: Path, images: int, seed: int, dataset_format: str, workers: int, valid: float
) -> None:
    """Render labelled images for the training of a detector.

    The images show random scenes of each CELL (a cell file or the name of a shipped cell) in turn.
    """
    with keep_stdout_clean():
        from executive.cli.cells import load_cells
        from executive.cli.progress import show_progress
        from executive.training.rendering import generate_dataset

        configs = load_cells(cells)
        with show_progress("rendering") as progress:
            generate_dataset(
                configs, out, image_count=images, seed=seed, layout=dataset_format, worker_count=workers,
                valid_fraction=valid, progress=progress,
            )  # fmt: skip
        click.echo(f"{out}: {images} images", err=True)
