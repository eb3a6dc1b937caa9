"""Parallel rendering of labelled images; the images do not depend on the number of processes."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from functools import partial
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np

from executive.cell.config import CellConfig
from executive.cells.sim.models import find_model_errors
from executive.cells.sim.scene_file import DECLARED_SCENE, SceneConfig
from executive.errors import InputError
from executive.processes import WorkerPool
from executive.training.dataset import DatasetEntry, build_image_path, save_image, write_annotations
from executive.training.labelled_image import LabelledImage
from executive.training.scene_renderer import IMAGE_SIZE, SceneRenderer

ResultT = TypeVar("ResultT")
ReportProgress = Callable[[int, int], None]
"""Callback with the number of finished images and the number of all images."""
BLOCK_SIZE = 40
"""Number of images per task of a worker process; each task builds a simulated world for each cell."""


def generate_dataset(
    configs: Mapping[str, CellConfig], out: Path, *, image_count: int, seed: int, layout: str,
    worker_count: int, valid_fraction: float, progress: ReportProgress,
) -> None:  # fmt: skip
    """Write a dataset of random scenes; the scenes alternate between the cells.

    Args:
        configs: Cells by name.
        out: Folder of the dataset.
        image_count: Number of images.
        seed: Seed of the random scenes.
        layout: `coco` or `yolo`.
        worker_count: Number of rendering processes.
        valid_fraction: Fraction of the images in the split `valid`, 0 to 1; these are the last images.
        progress: Called after each block of `BLOCK_SIZE` images.

    Raises:
        InputError: The layout is unknown, the cells differ in their classes, a model of an object is missing
            or has another size than in the cell file, or a file cannot be written.
    """
    cells = list(configs.values())
    classes = list(cells[0].objects)
    if any(list(cell.objects) != classes for cell in cells):
        found = "; ".join(f"{name} has {', '.join(cell.objects)}" for name, cell in configs.items())
        raise InputError(f"the cells of one dataset must have the same classes in the same order; {found}")
    for name, cell in configs.items():
        for key, message in find_model_errors(cell):
            raise InputError(f"{name}: {'.'.join(map(str, key))}: {message}")
    write_annotations(out, layout, [], classes)
    train_count = image_count - round(image_count * valid_fraction)
    render = partial(_render_dataset_images, cells, out, layout, seed, train_count)
    entries = _render_blocks(render, image_count, worker_count, progress)
    write_annotations(out, layout, entries, classes)


def render_run_frames(
    config: CellConfig, *, image_count: int, seed: int, worker_count: int, progress: ReportProgress,
    scene: SceneConfig = DECLARED_SCENE,
) -> list[LabelledImage]:  # fmt: skip
    """Return full frames of a cell's camera, each of a random scene like those of runs.

    The objects in the camera's view `table` are labelled.

    Args:
        config: The cell.
        image_count: Number of frames.
        seed: Seed of the random scenes.
        worker_count: Number of rendering processes.
        progress: Called after each block of `BLOCK_SIZE` frames.
        scene: Differences of the simulated world from the cell file.
    """
    return _render_blocks(partial(_render_frames, config, scene, seed), image_count, worker_count, progress)


def _render_blocks(
    render: Callable[[range], dict[int, ResultT]], count: int, worker_count: int, progress: ReportProgress
) -> list[ResultT]:
    """Return the results of `render` for images 0 to `count` - 1, in order, from worker processes."""
    image_numbers, results = range(count), dict[int, ResultT]()
    blocks = [image_numbers[start : start + BLOCK_SIZE] for start in image_numbers[::BLOCK_SIZE]]
    with WorkerPool(worker_count) as pool:
        for task in as_completed([pool.submit(render, block) for block in blocks]):
            results.update(task.result())
            progress(len(results), count)
    return [results[number] for number in image_numbers]


def _render_images(
    cells: Sequence[CellConfig], seed: int, image_numbers: range, scene: SceneConfig | None = None
) -> Iterator[tuple[int, LabelledImage]]:
    """Yield number and labelled image of random scenes; without `scene`, scenes vary more."""
    cv2.setNumThreads(1)
    with contextlib.ExitStack() as stack:
        renderers = [SceneRenderer(cell, scene) for cell in cells]
        for renderer in renderers:
            stack.callback(renderer.close)
        for number in image_numbers:
            image_seed = int(np.random.SeedSequence([seed, number]).generate_state(1, np.uint64)[0])
            yield number, renderers[number % len(cells)].render_image(image_seed, number)


def _render_dataset_images(
    cells: Sequence[CellConfig], out: Path, layout: str, seed: int, train_count: int, image_numbers: range
) -> dict[int, DatasetEntry]:
    """Render and save images in a worker process; return their dataset entries by image number."""
    entries = {}
    for number, image in _render_images(cells, seed, image_numbers):
        split, file = "train" if number < train_count else "valid", f"{image.file}.jpg"
        save_image(build_image_path(out, layout, split, file), image.image)
        # The ground truth for evaluations is stored as JSON.
        truth = {**image.truth, "matrix": image.truth["matrix"].tolist()}
        for name, digits in (("positions", 6), ("centres", 6), ("visible_fraction", 4)):
            truth[name] = truth[name].round(digits).tolist()
        size = (IMAGE_SIZE, IMAGE_SIZE)
        entries[number] = DatasetEntry(
            split, file, size, image.labels, image.boxes, image.ignored_boxes, truth
        )
    return entries


def _render_frames(
    config: CellConfig, scene: SceneConfig, seed: int, image_numbers: range
) -> dict[int, LabelledImage]:
    """Render frames in a worker process, and return them by image number."""
    return dict(_render_images([config], seed, image_numbers, scene))
