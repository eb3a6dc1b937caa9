"""Commands of detectors: `dataset`, `train` and `evaluate`."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from executive.cli import shared
from executive.errors import InputError
from executive.text.files import find_cell

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")
"""File name suffixes of the formats in which the worst mistakes can be saved."""


@click.command(name="dataset")
@click.argument("cells", metavar="CELL...", nargs=-1, required=True)
@click.option("--out", type=shared.FOLDER, required=True, help="Folder of the dataset.")
@click.option("--images", type=shared.COUNT, default=1000, help="Number of images.")
@shared.seed_option
@click.option(
    "--format", "dataset_format", type=click.Choice(["coco", "yolo"]), default="coco",
    help="Format of the dataset: COCO or YOLO, as exported by Roboflow.",
)  # fmt: skip
@shared.workers_option
@click.option("--valid", type=click.FloatRange(0, 1), default=0.1, help="Fraction of images for validation.")
def dataset_command(
    cells: tuple[str, ...], out: Path, images: int, seed: int, dataset_format: str, workers: int, valid: float
) -> None:
    """Render labelled images for the training of a detector.

    The images show random scenes of each CELL (a cell file or the name of a shipped cell) in turn. A cell
    that is named several times has several turns.
    """
    with shared.keep_stdout_clean():
        # The imports take a second, for which `--help` and wrong options must not wait.
        from executive.campaign.evaluation import load_cells
        from executive.training.rendering import generate_dataset

        configs_by_path = load_cells(cells)
        configs = [configs_by_path[find_cell(cell)] for cell in cells]
        with shared.show_progress("rendering") as progress:
            generate_dataset(
                configs, out, image_count=images, seed=seed, layout=dataset_format, worker_count=workers,
                valid_fraction=valid, progress=progress,
            )  # fmt: skip
        click.echo(f"{out}: {images} images", err=True)


@click.command(name="train")
@click.option(
    "--dataset", type=shared.FOLDER, required=True,
    help="COCO or YOLO dataset, from `executive dataset` or an export of an annotation tool.",
)  # fmt: skip
@click.option("--out", type=shared.FOLDER, required=True, help="Folder for model, checkpoints and metrics.")
@click.option(
    "--from", "model", type=shared.FILE, metavar="MODEL",
    help="Model file (.onnx or .pth) to fine-tune; by default, training starts from random weights.",
)  # fmt: skip
@click.option(
    "--rate", type=click.FloatRange(min=0, min_open=True),
    help="Learning rate; by default 1e-4 if --from is a model for the same classes, else 3e-4.",
)  # fmt: skip
@click.option("--epochs", type=shared.COUNT, default=20, help="Number of passes over the dataset.")
@shared.seed_option
def train_command(
    dataset: Path, out: Path, model: Path | None, rate: float | None, epochs: int, seed: int
) -> None:
    """Train the small RF-DETR detector.

    Needs the extra `train`: uv sync --extra train (a download of about 3 GB on Linux).
    """

    def print_epoch(epoch: int, metrics: dict[str, float]) -> None:
        values = ", ".join(f"{name} {value:.4g}" for name, value in metrics.items())
        click.echo(f"epoch {epoch} of {epochs}: {values}", err=True)

    with shared.keep_stdout_clean():
        # The imports take a second, for which `--help` and wrong options must not wait.
        from executive.training.train import load_dataset, train

        splits = load_dataset(dataset)
        for images in splits.values():
            click.echo(images.summary, err=True)
        with shared.show_progress("training") as progress:
            train(
                splits, out, start_model=model, learning_rate=rate, epochs=epochs, seed=seed,
                report_epoch=print_epoch, report_batch=progress,
            )  # fmt: skip
        click.echo(
            "add these lines to the cell file, with paths relative to the folder of the cell file:\n\n"
            "detectors:\n  trained:\n    kind: rfdetr\n"
            f"    model_path: {out / 'model.onnx'}\n    labels: {out / 'labels.txt'}",
            err=True,
        )


@click.command(name="evaluate")
@click.option(
    "--cell", "cells", metavar="CELL", multiple=True,
    help="Cell file or shipped cell whose detector is measured on rendered scenes; repeatable.",
)  # fmt: skip
@click.option(
    "--detector", "detector_name", metavar="NAME",
    help="Name of the detector in --cell; by default the first detector.",
)  # fmt: skip
@click.option("--dataset", type=shared.FOLDER, help="COCO or YOLO dataset instead of rendered scenes.")
@click.option(
    "--weights", type=shared.FILE, metavar="ONNX",
    help="Exported RF-DETR model (ONNX) to evaluate instead of the detector of a cell.",
)  # fmt: skip
@click.option(
    "--labels", type=shared.FILE,
    help="Class names of --weights, one per line; by default NAME.labels.txt or labels.txt beside NAME.onnx.",
)  # fmt: skip
@click.option("--images", type=shared.COUNT, default=200, help="Number of scenes to render per cell.")
@shared.seed_option
@click.option(
    "--threshold", type=click.FloatRange(0, 1),
    help="Minimum confidence of a detection; by default the threshold of the detector.",
)  # fmt: skip
@click.option(
    "--varied", is_flag=True,
    help="Vary the scenes as widely as for training; by default, render initial scenes of runs.",
)  # fmt: skip
@click.option(
    "--view", type=click.Choice(["table", "full"]), default="table",
    help="Region of the frame in which objects are detected.",
)  # fmt: skip
@shared.scene_option
@shared.overrides_option
@click.option(
    "--out", type=shared.FILE,
    help="File for the error rates that runs read; by default CELL.measured.json beside the cell file.",
)  # fmt: skip
@shared.workers_option
@click.option(
    "--force", is_flag=True,
    help="Store a measurement with precision or recall below 0.5, or with fewer than 30 objects of a class.",
)  # fmt: skip
@click.option("--sheet", type=shared.FILE, metavar="FILE.png", help="Image file for the worst mistakes.")
@shared.json_option
def evaluate_command(
    cells: tuple[str, ...], detector_name: str | None, dataset: Path | None, weights: Path | None,
    labels: Path | None, images: int, seed: int, threshold: float | None, varied: bool, view: str,
    scene: Path | None, overrides: dict[str, str], out: Path | None, workers: int, force: bool,
    sheet: Path | None, as_json: bool,
) -> None:  # fmt: skip
    """Measure the accuracy of a detector.

    The detector belongs to a cell (--cell), or is a model file (--weights) or the shipped model. The images
    come from --dataset, or are rendered scenes of the cell (by default of the shipped cell overhead). The
    error rates of a cell's detector are stored in a file that runs read; nothing is stored with --weights,
    --threshold, --varied, --scene or --view full, or with --set but without --out.
    """
    unknown_key = next((key for key in overrides if not key.startswith("cell.")), "")
    has_image_suffix = sheet is None or sheet.suffix.lower() in IMAGE_SUFFIXES
    shared.check_usage(
        (detector_name and weights, "--detector and --weights exclude each other; give one of them"),
        (detector_name and dataset and not cells, f"--detector {detector_name} needs --cell"),
        (labels and not weights, "--labels needs a model file; name it with --weights"),
        (dataset and varied, "--varied and --dataset exclude each other; give one of them"),
        (dataset and scene, "--scene and --dataset exclude each other; give one of them"),
        (varied and scene, "--scene and --varied exclude each other; give one of them"),
        (varied and view != "table", f"--view {view} and --varied exclude each other; give one of them"),
        (out and len(cells) != 1, f"--out {out} needs exactly one --cell"),
        (unknown_key, f"--set {unknown_key} is not a key of a cell; write cell.KEY.KEY=VALUE"),
        (not has_image_suffix, f'the name of --sheet "{sheet}" must end in {", ".join(IMAGE_SUFFIXES)}'),
    )
    results: dict[str, Any] = {}
    weaknesses: list[str] = []
    # Only a measurement under the conditions of a run predicts the error rates in runs.
    has_run_conditions = threshold is None and view == "table" and not (weights or varied or scene)
    is_stored = bool(cells) and has_run_conditions and (out is not None or not overrides)
    with shared.keep_stdout_clean():
        # The imports take a second, for which `--help` and wrong options must not wait.
        from executive.campaign import evaluation
        from executive.training.dataset import save_image
        from executive.training.evaluate import draw_sheet
        from executive.training.samples import LabelledDataset

        worst_mistakes: list[Any] = []
        samples = LabelledDataset(dataset) if dataset else None
        if samples:
            click.echo(samples.summary, err=True)
        settings = evaluation.ImageSettings(samples, images, seed, varied, view, workers, scene, threshold)
        cell_names = cells or (() if dataset else ("overhead",))
        configs = evaluation.load_cells(cell_names, overrides)
        detectors = list(evaluation.list_detectors(configs, detector_name, weights, labels))
        for detector in detectors:
            evaluation.check_detector(detector, settings)
        for detector in detectors:
            cell_name = detector.cell.cell if detector.cell else ""
            name = " on ".join(filter(None, (cell_name, str(dataset or ""))))
            start_time = time.monotonic()
            result = evaluation.measure_detector(detector, settings, worst_mistakes, shared.show_progress)
            shared.print_report(evaluation.list_metrics(name, detector.name, result))
            kind = detector.configs[detector.name].kind
            results[name] = {"detector": detector.name, "kind": kind, **result.to_dict()}
            if not is_stored or detector.cell is None:
                continue
            weakness = evaluation.find_weakness(detector, result)
            if weakness and not (force and result.reliability):
                weaknesses.append(f"the measurement of detector {detector.name} is not stored: {weakness}")
            else:
                source = f"--dataset {dataset}" if dataset else f"--images {images} --seed {seed}"
                repeat = f"executive evaluate --cell {detector.cell.cell} --detector {detector.name} {source}"
                duration = time.monotonic() - start_time
                path = evaluation.store_evaluation(detector, result, out, command=repeat, duration=duration)
                click.echo(f"stored in {path}", err=True)
        if sheet is not None:
            save_image(sheet, draw_sheet(worst_mistakes, ", ".join(results)))
            click.echo(f"{sheet}: the {len(worst_mistakes)} worst mistakes", err=True)
    if as_json:
        files = {"scene": scene and str(scene), "weights": weights and str(weights)}
        shared.print_json({"seed": seed, "varied": varied, **files, "measured": results})
    if weaknesses:
        advice = "check the labels, measure more images, or store the measurement with --force"
        raise InputError(f"{'; '.join(weaknesses)}; {advice}")
