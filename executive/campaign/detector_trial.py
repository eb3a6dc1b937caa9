"""Measuring detectors: which ones, on which images."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from executive.cell import Localizer
from executive.cell_config import CellConfig, DetectorConfig
from executive.errors import InputError
from executive.layout import object_class
from executive.mission.findings import alternatives
from executive.sim.datasets import generate, run_frames
from executive.sim.scene_file import load_scene
from executive.sim.spawn import count_that_fits
from executive.vision.detectors.registry import wrong_detectors
from executive.vision.evaluation.asking import CellDetector
from executive.vision.evaluation.evaluate import evaluate
from executive.vision.evaluation.figures import Evaluation
from executive.vision.evaluation.misses import WorstMisses
from executive.vision.evaluation.model_file import FLOOR, NAME, model_detector
from executive.vision.localization.build import build_localizer
from executive.vision.samples import LabelledImage, count_samples, read_samples

MAX_OBJECTS = 20
"""Largest number of objects in a scene, if the workspace has room for so many."""
Progress = Callable[[str], AbstractContextManager[Callable[[int, int], None]]]
"""Opens a progress bar of a name, which is told (done, all)."""


@dataclass(frozen=True)
class Scenes:
    """How fresh scenes are rendered.

    Attributes:
        images: How many of each cell.
        seed: What chance draws from.
        varied: True for scenes varied as widely as in training; False for scenes as a run begins with, with 0
            to `MAX_OBJECTS` objects as far as they fit, taken and searched as in a run.
        view: The part of a run's frame that is searched.
        workers: Processes that render.
        scene: Scene file that changes the world of scenes as a run begins with; None: nothing does.
    """

    images: int
    seed: int
    varied: bool
    view: str
    workers: int
    scene: Path | None = None


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

    def place(self, dataset: Path | None) -> str:
        """Return what to call a measurement of it, on its cell's scenes or on a data set."""
        if dataset is None:
            assert self.cell is not None
            return self.cell.cell
        return f"{self.cell.cell} on {dataset}" if self.cell else str(dataset)


def subjects(
    cells: Mapping[Path, CellConfig], detector: str | None, weights: Path | None, labels: Path | None
) -> Iterator[Subject]:
    """Yield the detectors to measure, one for every cell, or the one that stands alone.

    Args:
        cells: Cells by their file.
        detector: Name of the detector in them; None: the first.
        weights: A model file to measure instead.
        labels: Its class names; None: the file beside it.

    Raises:
        InputError: A cell has no detector of this name.
    """
    alone: dict[str, DetectorConfig] = {}
    if weights is not None:
        alone = {NAME: model_detector(weights, labels or _labels_beside(weights))}
    elif not cells:
        alone = {"embedded": DetectorConfig(kind="embedded", floor=FLOOR)}
    if not cells:
        yield Subject(None, alone, next(iter(alone)), Path())
    for file, config in cells.items():
        configs = alone or dict(config.detectors)
        name = detector or next(iter(configs))
        if name not in configs:
            hint = alternatives(name, configs, "Its detectors")
            raise InputError(f'the cell {config.cell} has no detector "{name}". {hint}')
        yield Subject(config, configs, name, file.parent)


def check_subject(subject: Subject, *, rendered: bool, scene: Path | None = None) -> None:
    """Refuse what cannot be rendered or built, which else would show after minutes of rendering.

    Raises:
        InputError: The cell is not simulated, the scene file is wrong, or a detector cannot be built.
    """
    cell = subject.cell
    if rendered and cell and cell.kind != "sim":
        raise InputError(
            f"scenes can be rendered of cells of kind sim, and {cell.cell} is of kind {cell.kind}; "
            "measure its detector on images of your own with --dataset"
        )
    if rendered and cell:
        load_scene(scene, cell)
    for (_, name, *_), sentence in wrong_detectors(subject.configs, subject.base):
        raise InputError(f"detector {name}: {sentence}")


def measure(
    subject: Subject,
    dataset: Path | None,
    scenes: Scenes,
    *,
    threshold: float | None,
    worst: WorstMisses,
    progress: Progress,
) -> Evaluation:
    """Return how good a detector is on the dataset or, without one, on scenes of its cell."""
    config = subject.cell
    in_run = config is not None and dataset is None and not scenes.varied
    with _images(subject, dataset, scenes, progress) as (samples, count):
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
            with progress(f"asking {subject.name}") as told:
                counted = _counted(samples, count, told)
                return evaluate(
                    asked, counted, threshold=threshold, localizer=localizer, worst=worst,
                    table=config.table if config and in_run else None,
                )  # fmt: skip


@contextlib.contextmanager
def _images(
    subject: Subject, dataset: Path | None, scenes: Scenes, progress: Progress
) -> Iterator[tuple[Iterator[LabelledImage], int]]:
    """Provide the images that a detector is measured on, and how many they are."""
    config = subject.cell
    if dataset is not None or config is None:
        assert dataset is not None
        yield read_samples(dataset), count_samples(dataset)
        return
    if not scenes.varied:
        with progress(f"rendering {config.cell}") as told:
            table = {"objects": (0, count_that_fits(config, MAX_OBJECTS))}
            filled = config.model_copy(update={"table": config.table.model_copy(update=table)})
            frames = run_frames(
                filled, images=scenes.images, seed=scenes.seed, workers=scenes.workers, progress=told,
                scene=load_scene(scenes.scene, config),
            )  # fmt: skip
        yield iter(frames), scenes.images
        return
    with tempfile.TemporaryDirectory() as folder:
        with progress(f"rendering {config.cell}") as told:
            generate(
                {config.cell: config}, Path(folder), images=scenes.images, seed=scenes.seed, layout="coco",
                workers=scenes.workers, valid=1.0, progress=told,
            )  # fmt: skip
        yield read_samples(Path(folder)), scenes.images


def _counted(
    samples: Iterator[LabelledImage], count: int, told: Callable[[int, int], None]
) -> Iterator[LabelledImage]:
    """Yield the images, and tell after each that so many of so many are done."""
    for done, sample in enumerate(samples, 1):
        yield sample
        told(done, count)


def _localizer(config: CellConfig) -> Localizer | None:
    """Return the cell's localizer; None for the ray, which needs the scene itself."""
    if config.localization == "ray":
        return None
    classes = {label: object_class(label, kind) for label, kind in config.objects.items()}
    return build_localizer(config.localization, classes, lambda _origin, _direction: None)


def _labels_beside(weights: Path) -> Path:
    """Return the label file that belongs to a model; the first that exists, or else the usual one."""
    own = weights.with_name(f"{weights.stem}.labels.txt")
    return own if own.is_file() else weights.with_name("labels.txt")
