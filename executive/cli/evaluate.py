"""`executive evaluate`: measure how good a detector is."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from executive.cli.options import json_option, seed_option
from executive.cli.output import print_json, stdout_kept_clean

if TYPE_CHECKING:
    from executive.cell import Localizer
    from executive.cell_config import CellConfig, DetectorConfig
    from executive.vision.evaluation.figures import Evaluation
    from executive.vision.evaluation.misses import WorstMisses
    from executive.vision.samples import LabelledImage

PICTURES = (".png", ".jpg", ".jpeg")
"""Kinds of files that the sheet of misses can be."""


@dataclass(frozen=True)
class Scenes:
    """How fresh scenes are rendered.

    Attributes:
        images: How many of each cell.
        seed: What chance draws from.
        as_run: As a run begins with, taken and searched as in a run; else varied as in training.
        view: The part of a run's frame that is searched.
        workers: Processes that render.
    """

    images: int
    seed: int
    as_run: bool
    view: str
    workers: int


@dataclass(frozen=True, eq=False)
class Subject:
    """A detector to measure.

    Attributes:
        cell: The cell that it is from, or None for one that stands alone.
        configs: It and what it may rest on.
        name: Its name among them.
        base: Folder that paths in its options start from.
    """

    cell: CellConfig | None
    configs: dict[str, DetectorConfig]
    name: str
    base: Path


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
    cores: int | None,
    workers: int,
    sheet: Path | None,
    as_json: bool,
) -> None:
    """Measure a detector on fresh scenes of cells, or on labelled images.

    What is measured is a cell's detector with all that its section says, or a model file (--weights), or
    with neither the detector that ships with this project.
    """
    _check(cells, detector, dataset, weights, labels, as_run, view, sheet)
    scenes = Scenes(images, seed, as_run, view, workers)
    measured: dict[str, Any] = {}
    with stdout_kept_clean():
        from executive.view.detector_figures import print_figures
        from executive.vision.evaluation.misses import WorstMisses

        worst = WorstMisses()
        subjects = list(_subjects(cells or (() if dataset else ("overhead",)), detector, weights, labels))
        for subject in subjects:
            _check_subject(subject, rendered=dataset is None)
        for subject in subjects:
            where = _where(subject, dataset)
            evaluation = _measure(subject, dataset, scenes, threshold, cores, worst)
            print_figures(where, subject.name, evaluation)
            kind = subject.configs[subject.name].kind
            measured[where] = {"detector": subject.name, "kind": kind, **evaluation.as_dict()}
        if sheet is not None:
            from executive.vision.evaluation.sheet import write_sheet

            misses = worst.worst()
            write_sheet(sheet, misses, ", ".join(measured))
            click.echo(f"the {len(misses)} worst in {sheet}", err=True)
    if as_json:
        given = {"seed": seed, "as_run": as_run, "weights": weights and str(weights)}
        print_json({**given, "measured": measured})


def _check(
    cells: tuple[str, ...], detector: str | None, dataset: Path | None, weights: Path | None,
    labels: Path | None, as_run: bool, view: str, sheet: Path | None,
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
    if sheet is not None and sheet.suffix.lower() not in PICTURES:
        raise click.UsageError(f'"{sheet}" is no picture; its name must end in {", ".join(PICTURES)}')


def _subjects(
    cells: tuple[str, ...], detector: str | None, weights: Path | None, labels: Path | None
) -> Iterator[Subject]:
    """Yield the detectors to measure, one for every cell, or the one that stands alone.

    Raises:
        InputError: There is no such cell, or none of its detectors has this name.
    """
    from executive.cell_config import DetectorConfig
    from executive.cli.cells import find_cell, load_cells
    from executive.errors import InputError
    from executive.mission.findings import alternatives
    from executive.vision.evaluation.model_file import FLOOR, NAME, model_detector

    alone: dict[str, DetectorConfig] = {}
    if weights is not None:
        alone = {NAME: model_detector(weights, labels or _labels_beside(weights))}
    elif not cells:
        alone = {"embedded": DetectorConfig(kind="embedded", floor=FLOOR)}
    if not cells:
        yield Subject(None, alone, next(iter(alone)), Path())
    for config, file in zip(load_cells(cells).values(), map(find_cell, cells), strict=True):
        configs = alone or dict(config.detectors)
        name = detector or next(iter(configs))
        if name not in configs:
            hint = alternatives(name, configs, "Its detectors")
            raise InputError(f'the cell {config.cell} has no detector "{name}". {hint}')
        yield Subject(config, configs, name, file.parent)


def _check_subject(subject: Subject, *, rendered: bool) -> None:
    """Refuse what cannot be rendered or built, which else would show after minutes of rendering.

    Raises:
        InputError: The cell is not simulated, or one of its detectors cannot be built.
    """
    from executive.errors import InputError
    from executive.vision.detectors.registry import wrong_detectors

    cell = subject.cell
    if rendered and cell and cell.kind != "sim":
        raise InputError(
            f"scenes can be rendered of cells of kind sim, and {cell.cell} is of kind {cell.kind}; "
            "measure its detector on images of your own with --dataset"
        )
    for (_, name, *_), sentence in wrong_detectors(subject.configs, subject.base):
        raise InputError(f"detector {name}: {sentence}")


def _measure(
    subject: Subject, dataset: Path | None, scenes: Scenes, threshold: float | None, cores: int | None,
    worst: WorstMisses,
) -> Evaluation:  # fmt: skip
    """Return how good a detector is on the dataset or, without one, on scenes of its cell."""
    from executive.vision.evaluation.asking import CellDetector
    from executive.vision.evaluation.cores import only_cores
    from executive.vision.evaluation.evaluate import evaluate

    config = subject.cell
    in_run = config is not None and scenes.as_run
    with _images(subject, dataset, scenes) as samples, only_cores(cores):
        asked = CellDetector(
            subject.configs,
            subject.name,
            base=subject.base,
            camera=next(iter(config.cameras.values())) if config and in_run else None,
            view=scenes.view,
            classes=tuple(config.objects) if config else None,
        )
        with contextlib.closing(asked):
            localizer = _localizer(config) if config and in_run else None
            return evaluate(asked, samples, threshold=threshold, localizer=localizer, worst=worst)


@contextlib.contextmanager
def _images(subject: Subject, dataset: Path | None, scenes: Scenes) -> Iterator[Iterator[LabelledImage]]:
    """Provide the images that a detector is measured on."""
    from executive.cli.progress import bar
    from executive.sim.datasets import generate
    from executive.sim.run_frames import run_frames
    from executive.vision.samples import read_samples

    config = subject.cell
    if dataset is not None or config is None:
        assert dataset is not None
        yield read_samples(dataset)
        return
    if scenes.as_run:
        with bar(f"rendering {config.cell}") as progress:
            frames = run_frames(
                config, images=scenes.images, seed=scenes.seed, workers=scenes.workers, progress=progress
            )
        yield iter(frames)
        return
    with tempfile.TemporaryDirectory() as folder:
        with bar(f"rendering {config.cell}") as progress:
            generate(
                {config.cell: config}, Path(folder), images=scenes.images, seed=scenes.seed, layout="coco",
                workers=scenes.workers, valid=1.0, progress=progress,
            )  # fmt: skip
        yield read_samples(Path(folder))


def _localizer(config: CellConfig) -> Localizer | None:
    """Return the cell's localizer; None for the ray, which needs the scene itself."""
    from executive.layout import as_class
    from executive.vision.localization.build import build_localizer

    if config.localization == "ray":
        return None
    classes = {label: as_class(label, kind) for label, kind in config.objects.items()}
    return build_localizer(config.localization, classes, lambda _origin, _direction: None)


def _where(subject: Subject, dataset: Path | None) -> str:
    """Return what to call a measurement."""
    if dataset is None:
        assert subject.cell is not None
        return subject.cell.cell
    return f"{subject.cell.cell} on {dataset}" if subject.cell else str(dataset)


def _labels_beside(weights: Path) -> Path:
    """Return the label file that belongs to a model; the first that exists, or else the usual one."""
    usual = weights.with_name("labels.txt")
    own = weights.with_name(f"{weights.stem}.labels.txt")
    return own if own.is_file() else usual
