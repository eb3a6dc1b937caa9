"""`executive evaluate`: measure the accuracy of a detector."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from executive.cli import options
from executive.cli.streams import print_json, stdout_kept_clean

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")
"""Suffixes of the file formats in which the sheet of misses can be saved."""


@click.command(name="evaluate")
@click.option(
    "--cell", "cells", metavar="CELL", multiple=True,
    help="Cell whose detector is measured on random scenes of the cell; repeatable.",
)  # fmt: skip
@click.option("--detector", metavar="NAME", help="Name of the cell's detector; by default the first.")
@click.option(
    "--dataset", type=options.FOLDER, metavar="FOLDER",
    help="COCO or YOLO folder of labelled images to use instead of random scenes.",
)  # fmt: skip
@click.option(
    "--weights", type=options.FILE, metavar="ONNX",
    help="Exported RF-DETR to measure instead of a cell's detector.",
)  # fmt: skip
@click.option(
    "--labels", type=options.FILE, metavar="FILE",
    help="Class names of --weights, one per line; by default labels.txt or NAME.labels.txt beside it.",
)  # fmt: skip
@click.option("--images", type=options.COUNT, default=200, help="Number of scenes to render per cell.")
@options.seed_option
@click.option(
    "--threshold", type=click.FloatRange(0, 1),
    help="Lowest confidence at which a detection counts; by default the threshold of the detector.",
)  # fmt: skip
@click.option(
    "--varied", is_flag=True,
    help="Vary scenes as widely as in training; by default scenes are as at the start of a run.",
)  # fmt: skip
@click.option(
    "--view", type=click.Choice(["table", "full"]), default="table",
    help="Part of the frame to search.",
)  # fmt: skip
@options.scene_option
@options.overrides_option
@click.option(
    "--out", type=options.FILE, metavar="FILE",
    help="File for the measurement that runs read; by default CELL.measured.json beside the cell file.",
)  # fmt: skip
@click.option("--workers", type=options.COUNT, default=2, help="Number of rendering processes.")
@click.option("--sheet", type=options.FILE, metavar="FILE.png", help="Image file for the worst misses.")
@options.json_option
def command(
    cells: tuple[str, ...], detector: str | None, dataset: Path | None, weights: Path | None,
    labels: Path | None, images: int, seed: int, threshold: float | None, varied: bool, view: str,
    scene: Path | None, overrides: dict[str, str], out: Path | None, workers: int, sheet: Path | None,
    as_json: bool,
) -> None:  # fmt: skip
    """Measure a detector on random scenes of cells, or on labelled images.

    The detector is that of a cell with all settings of its section, or a model file (--weights), by default
    the one that ships with this project. The measurement of a cell's detector, as it is declared, is stored:
    runs take the error rates of the detector from it.
    """
    unknown = next((key for key in overrides if not key.startswith("cell.")), "")
    is_picture = sheet is None or sheet.suffix.lower() in IMAGE_SUFFIXES
    options.refuse(
        (detector and weights, "--detector is of a cell and --weights a model file; give one of them"),
        (detector and dataset and not cells, f"--detector {detector} is of which cell? Name it with --cell"),
        (labels and not weights, "--labels are those of a model file; name it with --weights"),
        (dataset and varied, "--varied renders scenes, and --dataset brings images; give one of them"),
        (dataset and scene, "--scene renders scenes, and --dataset brings images; give one of them"),
        (varied and scene, f"--scene {scene} changes scenes of the cell; --varied draws them itself"),
        (varied and view != "table", f"--view {view} is a part of a run's frame; leave out --varied"),
        (out and len(cells) != 1, f"--out {out} is the file for one cell; name the cell with --cell"),
        (unknown, f"--set {unknown} is no key of a cell; write cell.KEY.KEY=VALUE"),
        (not is_picture, f'"{sheet}" is no picture; its name must end in {", ".join(IMAGE_SUFFIXES)}'),
    )
    measured: dict[str, Any] = {}
    # A measurement under other conditions than those of a run does not predict the error rates of runs.
    as_declared = not (weights or varied or scene or threshold) and view == "table"
    stored = bool(cells) and as_declared and (out is not None or not overrides)
    with stdout_kept_clean():
        from executive.campaign import evaluation
        from executive.cli.cells import find_cell, load_cells
        from executive.cli.progress import bar, report_polygons
        from executive.training.evaluation.worst_mistakes import WorstMistakes
        from executive.view.figures.detector import print_metrics

        worst, scenes = WorstMistakes(), evaluation.SceneSettings(images, seed, varied, view, workers, scene)
        cell_names = cells or (() if dataset else ("overhead",))
        files = dict(zip(map(find_cell, cell_names), load_cells(cell_names, overrides).values(), strict=True))
        tested_detectors = list(evaluation.list_detectors(files, detector, weights, labels))
        if dataset is not None:
            report_polygons(dataset)
        for tested in tested_detectors:
            evaluation.check_detector(tested, renders_scenes=dataset is None, scene=scene)
        for tested in tested_detectors:
            measurement, start = tested.make_measurement_name(dataset), time.monotonic()
            result = evaluation.measure_detector(
                tested, dataset, scenes, threshold=threshold, worst_mistakes=worst, progress=bar
            )
            print_metrics(measurement, tested.name, result)
            kind = tested.configs[tested.name].kind
            measured[measurement] = {"detector": tested.name, "kind": kind, **result.to_dict()}
            if stored and tested.cell is not None:
                source = f"--dataset {dataset}" if dataset else f"--images {images} --seed {seed}"
                repeat = f"executive evaluate --cell {tested.cell.cell} --detector {tested.name} {source}"
                seconds = time.monotonic() - start
                path = evaluation.store_evaluation(tested, result, out, command=repeat, seconds=seconds)
                click.echo(f"stored in {path}", err=True)
        if sheet is not None:
            from executive.training.dataset import save_image
            from executive.training.evaluation.worst_mistakes import draw_sheet

            save_image(sheet, draw_sheet(worst.kept, ", ".join(measured)))
            click.echo(f"the {len(worst.kept)} worst in {sheet}", err=True)
    if as_json:
        named_files = {"scene": scene and str(scene), "weights": weights and str(weights)}
        print_json({"seed": seed, "varied": varied, **named_files, "measured": measured})
