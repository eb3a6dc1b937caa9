"""`executive evaluate`: measure the accuracy of a detector."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from executive.cli import options
from executive.cli.streams import keep_stdout_clean, print_json
from executive.errors import InputError

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")
"""File name suffixes of the formats in which the worst mistakes can be saved."""


@click.command(name="evaluate")
@click.option(
    "--cell", "cells", metavar="CELL", multiple=True,
    help="Cell file or shipped cell whose detector is measured on rendered scenes; repeatable.",
)  # fmt: skip
@click.option(
    "--detector", "detector_name", metavar="NAME",
    help="Name of the detector in --cell; by default the first detector.",
)  # fmt: skip
@click.option("--dataset", type=options.FOLDER, help="COCO or YOLO dataset instead of rendered scenes.")
@click.option(
    "--weights", type=options.FILE, metavar="ONNX",
    help="Exported RF-DETR model (ONNX) to evaluate instead of the detector of a cell.",
)  # fmt: skip
@click.option(
    "--labels", type=options.FILE,
    help="Class names of --weights, one per line; by default NAME.labels.txt or labels.txt beside NAME.onnx.",
)  # fmt: skip
@click.option("--images", type=options.COUNT, default=200, help="Number of scenes to render per cell.")
@options.seed_option
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
@options.scene_option
@options.overrides_option
@click.option(
    "--out", type=options.FILE,
    help="File for the error rates that runs read; by default CELL.measured.json beside the cell file.",
)  # fmt: skip
@options.workers_option
@click.option(
    "--force", is_flag=True,
    help="Store a measurement with precision or recall below 0.5, or with fewer than 30 objects of a class.",
)  # fmt: skip
@click.option("--sheet", type=options.FILE, metavar="FILE.png", help="Image file for the worst mistakes.")
@options.json_option
def command(
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
    options.check_usage(
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
    with keep_stdout_clean():
        from executive.campaign import evaluation
        from executive.cli.cells import find_cell, load_cells
        from executive.cli.progress import print_report, show_progress
        from executive.training.samples import LabelledDataset
        from executive.view.detector_results import list_metrics

        worst_mistakes: list[Any] = []
        samples = LabelledDataset(dataset) if dataset else None
        if samples:
            click.echo(samples.summary, err=True)
        settings = evaluation.ImageSettings(samples, images, seed, varied, view, workers, scene, threshold)
        cell_names = cells or (() if dataset else ("overhead",))
        configs = load_cells(cell_names, overrides)
        configs_by_file = dict(zip(map(find_cell, cell_names), configs.values(), strict=True))
        detectors = list(evaluation.list_detectors(configs_by_file, detector_name, weights, labels))
        for detector in detectors:
            evaluation.check_detector(detector, settings)
        for detector in detectors:
            name, start_time = detector.make_measurement_name(dataset), time.monotonic()
            result = evaluation.measure_detector(detector, settings, worst_mistakes, show_progress)
            print_report(list_metrics(name, detector.name, result))
            kind = detector.configs[detector.name].kind
            results[name] = {"detector": detector.name, "kind": kind, **result.to_dict()}
            if not is_stored or detector.cell is None:
                continue
            weakness = evaluation.find_weakness(detector, result)
            if weakness and not (force and result.reliability):
                weaknesses.append(f"the measurement of detector {detector.name} is not stored: {weakness}")
            else:
                source = f"--dataset {dataset}" if dataset else f"--images {images} --seed {seed}"
                arguments = f"--cell {detector.cell.cell} --detector {detector.name} {source}"
                repeat, duration = f"executive evaluate {arguments}", time.monotonic() - start_time
                path = evaluation.store_evaluation(detector, result, out, command=repeat, duration=duration)
                click.echo(f"stored in {path}", err=True)
        if sheet is not None:
            from executive.training.dataset import save_image
            from executive.training.evaluate import draw_sheet

            save_image(sheet, draw_sheet(worst_mistakes, ", ".join(results)))
            click.echo(f"{sheet}: the {len(worst_mistakes)} worst mistakes", err=True)
    if as_json:
        files = {"scene": scene and str(scene), "weights": weights and str(weights)}
        print_json({"seed": seed, "varied": varied, **files, "measured": results})
    if weaknesses:
        advice = "check the labels, measure more images, or store the measurement with --force"
        raise InputError(f"{'; '.join(weaknesses)}; {advice}")
