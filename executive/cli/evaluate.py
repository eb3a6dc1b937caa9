"""`executive evaluate`: measure how good a detector is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from executive.cli.options import json_option, scene_option, seed_option
from executive.cli.output import print_json, stdout_kept_clean

PICTURES = (".png", ".jpg", ".jpeg")
"""Kinds of files that the sheet of misses can be."""


@click.command(name="evaluate")
@click.option(
    "--cell", "cells", metavar="CELL", multiple=True,
    help="Cell whose detector is measured, on fresh scenes of it; repeatable.",
)  # fmt: skip
@click.option("--detector", metavar="NAME", help="Which of the cell's detectors; without it, the first.")
@click.option(
    "--dataset", type=click.Path(path_type=Path, file_okay=False), metavar="FOLDER",
    help="COCO or YOLO folder of labelled images to measure on, instead of fresh scenes.",
)  # fmt: skip
@click.option(
    "--weights", type=click.Path(path_type=Path, dir_okay=False), metavar="ONNX",
    help="Exported RF-DETR to measure instead of a cell's detector.",
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
    "--threshold", type=click.FloatRange(0, 1),
    help="Confidence from which a detection counts; without it, the detector's own.",
)  # fmt: skip
@click.option(
    "--as-run", is_flag=True,
    help="Scenes as a run begins with, searched as in a run; else varied as widely as in training.",
)  # fmt: skip
@click.option(
    "--view", type=click.Choice(["table", "full"]), default="table", show_default=True,
    help="The part of a run's frame to search, with --as-run.",
)  # fmt: skip
@scene_option
@click.option("--cores", type=click.IntRange(min=1), help="Processor cores the detector may use; else all.")
@click.option(
    "--workers", type=click.IntRange(min=1), default=2, show_default=True, help="Processes to render."
)
@click.option(
    "--sheet", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE.png",
    help="Picture of the worst misses to write.",
)  # fmt: skip
@json_option
def command(
    cells: tuple[str, ...],
    detector: str | None,
    dataset: Path | None,
    weights: Path | None,
    labels: Path | None,
    images: int,
    seed: int,
    threshold: float | None,
    as_run: bool,
    view: str,
    scene: Path | None,
    cores: int | None,
    workers: int,
    sheet: Path | None,
    as_json: bool,
) -> None:
    """Measure a detector on fresh scenes of cells, or on labelled images.

    What is measured is a cell's detector with all that its section says, or a model file (--weights), or
    with neither the detector that ships with this project.
    """
    _check(cells, detector, dataset, weights, labels, as_run, view, scene, sheet)
    measured: dict[str, Any] = {}
    with stdout_kept_clean():
        from executive.campaign.detector_trial import Scenes, check_subject, measure, subjects
        from executive.cli.cells import find_cell, load_cells
        from executive.cli.progress import bar
        from executive.view.figures.detector import print_figures
        from executive.vision.evaluation.misses import WorstMisses

        worst, scenes = WorstMisses(), Scenes(images, seed, as_run, view, workers, scene)
        named = cells or (() if dataset else ("overhead",))
        files = dict(zip(map(find_cell, named), load_cells(named).values(), strict=True))
        asked = list(subjects(files, detector, weights, labels))
        for subject in asked:
            check_subject(subject, rendered=dataset is None, scene=scene)
        for subject in asked:
            where = subject.place(dataset)
            evaluation = measure(
                subject, dataset, scenes, threshold=threshold, cores=cores, worst=worst, progress=bar
            )
            print_figures(where, subject.name, evaluation)
            kind = subject.configs[subject.name].kind
            measured[where] = {"detector": subject.name, "kind": kind, **evaluation.as_dict()}
        if sheet is not None:
            from executive.vision.evaluation.sheet import write_sheet

            write_sheet(sheet, worst.kept, ", ".join(measured))
            click.echo(f"the {len(worst.kept)} worst in {sheet}", err=True)
    if as_json:
        named_files = {"scene": scene and str(scene), "weights": weights and str(weights)}
        print_json({"seed": seed, "as_run": as_run, **named_files, "measured": measured})


def _check(
    cells: tuple[str, ...], detector: str | None, dataset: Path | None, weights: Path | None,
    labels: Path | None, as_run: bool, view: str, scene: Path | None, sheet: Path | None,
) -> None:  # fmt: skip
    """Refuse options that contradict each other, before anything is rendered."""
    if detector is not None and weights is not None:
        raise click.UsageError("--detector is of a cell and --weights a model file; give one of them")
    if detector is not None and not cells and dataset is not None:
        raise click.UsageError(f"--detector {detector} is of which cell? Name it with --cell")
    if labels is not None and weights is None:
        raise click.UsageError("--labels are those of a model file; name it with --weights")
    if dataset is not None and as_run:
        raise click.UsageError("--as-run renders scenes, and --dataset brings images; give one of them")
    if view != "table" and not as_run:
        raise click.UsageError(f"--view {view} is a part of a run's frame; give --as-run with it")
    if scene is not None and not as_run:
        raise click.UsageError(f"--scene {scene} changes scenes as a run begins with; give --as-run with it")
    if sheet is not None and sheet.suffix.lower() not in PICTURES:
        raise click.UsageError(f'"{sheet}" is no picture; its name must end in {", ".join(PICTURES)}')
