"""`executive dataset`: render labelled images of cells."""

from __future__ import annotations

from pathlib import Path

import click

from executive.cli.options import COUNT, FOLDER, seed_option
from executive.cli.streams import stdout_kept_clean


@click.command(name="dataset")
@click.argument("cells", metavar="CELL...", nargs=-1, required=True)
@click.option("--out", type=FOLDER, required=True, help="Folder to fill.")
@click.option("--images", type=COUNT, default=1000, help="Number of images.")
@seed_option
@click.option(
    "--format", "layout", type=click.Choice(["coco", "yolo"]), default="coco",
    help="Layout of the folder, as Roboflow exports it.",
)  # fmt: skip
@click.option("--workers", type=COUNT, default=2, help="Number of processes.")
@click.option("--valid", type=click.FloatRange(0, 1), default=0.1, help="Share kept for validation.")
def command(
    cells: tuple[str, ...], out: Path, images: int, seed: int, layout: str, workers: int, valid: float
) -> None:
    """Render random scenes of all CELLs in turn, and label every object with its box."""
    with stdout_kept_clean():
        from executive.cli.cells import load_cells
        from executive.cli.progress import bar
        from executive.training.rendering import generate_dataset

        configs = load_cells(cells)
        with bar("rendering") as progress:
            generate_dataset(
                configs, out, images=images, seed=seed, layout=layout, workers=workers, valid_fraction=valid,
                progress=progress,
            )  # fmt: skip
        click.echo(f"{images} images in {out}", err=True)
