"""Parallel rendering of labelled images; the images do not depend on the number of processes."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np

from executive.cell.config import CellConfig
from executive.cell.frame import Box
from executive.cells.sim.models import find_model_errors
from executive.cells.sim.scene_file import DECLARED_SCENE, SceneConfig
from executive.cells.sim.scenes import IMAGE_SIZE, Sample, SceneRenderer
from executive.errors import InputError
from executive.geometry import Array
from executive.processes import WorkerPool
from executive.training.dataset import DatasetEntry, build_image_path, save_image, write_annotations
from executive.training.labelled_image import LabelledImage

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
        raise InputError(
            "the cells of one dataset must have the same classes in the same order; "
            + "; ".join(f"{name} has {', '.join(cell.objects)}" for name, cell in configs.items())
        )
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


def _render_samples(
    cells: Sequence[CellConfig], seed: int, image_numbers: range, scene: SceneConfig | None = None
) -> Iterator[tuple[int, str, Sample]]:
    """Yield image number, camera name and sample of random scenes; without `scene`, scenes vary more."""
    cv2.setNumThreads(1)
    cameras = [next(iter(cell.cameras)) for cell in cells]
    with contextlib.ExitStack() as stack:
        renderers = [SceneRenderer(cell, camera, scene) for cell, camera in zip(cells, cameras, strict=True)]
        for renderer in renderers:
            stack.callback(renderer.close)
        for number in image_numbers:
            cell_index = number % len(cells)
            sample_seed = int(np.random.SeedSequence([seed, number]).generate_state(1, np.uint64)[0])
            yield number, cameras[cell_index], renderers[cell_index].render_sample(sample_seed)


def _render_dataset_images(
    cells: Sequence[CellConfig], out: Path, layout: str, seed: int, train_count: int, image_numbers: range
) -> dict[int, DatasetEntry]:
    """Render and save images in a worker process; return their dataset entries by image number."""
    entries = {}
    for number, camera, sample in _render_samples(cells, seed, image_numbers):
        split, file = "train" if number < train_count else "valid", f"{camera}_{number:06d}.jpg"
        save_image(build_image_path(out, layout, split, file), sample.image)
        entries[number] = _make_dataset_entry(sample, split, file, camera)
    return entries


def _render_frames(
    config: CellConfig, scene: SceneConfig, seed: int, image_numbers: range
) -> dict[int, LabelledImage]:
    """Render frames in a worker process, and return them by image number."""
    samples = _render_samples([config], seed, image_numbers, scene)
    return {i: to_labelled_frame(sample, camera, f"{camera}_{i:06d}") for i, camera, sample in samples}


def _make_dataset_entry(sample: Sample, split: str, file: str, camera: str) -> DatasetEntry:
    """Return the dataset entry of a sample, with the ground truth for evaluations as JSON values."""
    truth = _collect_truth(sample, camera, sample.region)
    truth["matrix"] = sample.matrix.tolist()
    for name, digits in (("positions", 6), ("centres", 6), ("visible_fraction", 4)):
        truth[name] = truth[name].round(digits).tolist()
    boxes, ignored_boxes = _to_boxes(sample.boxes), _to_boxes(sample.ignored)
    return DatasetEntry(split, file, (IMAGE_SIZE, IMAGE_SIZE), sample.labels, boxes, ignored_boxes, truth)


def to_labelled_frame(sample: Sample, camera: str, file: str) -> LabelledImage:
    """Return the full frame of a sample; `sample.image` is a scaled part of the full frame."""
    assert sample.frame is not None
    height, width = sample.frame.shape[:2]
    left, top, right, _ = sample.region
    scale, corner = (right - left) / IMAGE_SIZE, [left, top, left, top]
    return LabelledImage(
        file=file, image=sample.frame, labels=sample.labels,
        boxes=_to_boxes(sample.boxes * scale + corner),
        ignored_boxes=_to_boxes(sample.ignored * scale + corner),
        truth=_collect_truth(sample, camera, (0, 0, width, height)),
        region=sample.region, depth=sample.depth, second_image=sample.second_frame,
    )  # fmt: skip


def _collect_truth(sample: Sample, camera: str, part: Box) -> dict[str, Any]:
    """Return the ground truth of an image that shows the region `part` of the camera's frame [pixel]."""
    return {
        "camera": camera,
        "part": part,
        "matrix": sample.matrix,
        "X_WC": sample.X_WC.to_rounded_list(9),
        "labels": sample.labels,
        "positions": sample.positions,
        "centres": sample.centres,
        "visible_fraction": sample.visible_fraction,
    }


def _to_boxes(boxes: Array) -> tuple[Box, ...]:
    """Return the rows of an array `(N, 4)` [pixel] as boxes."""
    return tuple((left, top, right, bottom) for left, top, right, bottom in boxes.tolist())
