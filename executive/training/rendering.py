"""Rendering of labelled images in parallel; the number of processes does not change the images."""

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
from executive.cells.sim.models import find_missing_models
from executive.cells.sim.scene_file import DECLARED_SCENE, SceneConfig
from executive.cells.sim.scenes import IMAGE_SIZE, Sample, SceneRenderer
from executive.errors import InputError
from executive.geometry import Array
from executive.processes import WorkerPool
from executive.training.dataset import DatasetEntry, build_image_path, save_image, write_annotations
from executive.training.labelled_image import LabelledImage

ItemT = TypeVar("ItemT")
Progress = Callable[[int, int], None]
"""Callback with the number of finished images and of all images."""
BLOCK_SIZE = 40
"""Number of images per task of a worker process, which builds one world per cell and task."""


def generate_dataset(
    configs: Mapping[str, CellConfig],
    out: Path,
    *,
    images: int,
    seed: int,
    layout: str,
    workers: int,
    valid_fraction: float,
    progress: Progress,
) -> None:
    """Write a dataset of random scenes of all cells in turn; the last images are for validation.

    Args:
        configs: Cells by name.
        out: Folder of the dataset.
        images: Number of images.
        seed: Seed; the dataset is a function of the cells and the seed.
        layout: `coco` or `yolo`.
        workers: Number of processes that render.
        valid_fraction: Fraction of the images in the split `valid`, 0 to 1.
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
        for key, sentence in find_missing_models(cell):
            raise InputError(f"{name}: {'.'.join(map(str, key))}: {sentence}")
    write_annotations(out, layout, [], classes)
    render = partial(_render_block, cells, out, layout, seed, images - round(images * valid_fraction))
    write_annotations(out, layout, _make_in_blocks(render, images, workers, progress), classes)


def render_run_frames(
    config: CellConfig,
    *,
    images: int,
    seed: int,
    workers: int,
    progress: Progress,
    scene: SceneConfig = DECLARED_SCENE,
) -> list[LabelledImage]:
    """Return full frames of a cell's camera, each of a random initial scene of a run.

    The objects in the camera's view `table` are labelled.

    Args:
        config: The cell.
        images: Number of frames.
        seed: Seed; the frames are a function of cell, scene and seed.
        workers: Number of processes that render.
        progress: Called after each block of `BLOCK_SIZE` frames.
        scene: Differences of the simulated world from the cell file.
    """
    return _make_in_blocks(partial(_render_frames, config, scene, seed), images, workers, progress)


def _make_in_blocks(
    make: Callable[[range], dict[int, ItemT]], count: int, workers: int, progress: Progress
) -> list[ItemT]:
    """Return items 0 to `count` - 1 in order; worker processes call `make` for blocks of item numbers."""
    made: dict[int, ItemT] = {}
    with WorkerPool(workers) as pool:
        starts = range(0, count, BLOCK_SIZE)
        blocks = [pool.submit(make, range(first, min(first + BLOCK_SIZE, count))) for first in starts]
        for block in as_completed(blocks):
            made.update(block.result())
            progress(len(made), count)
    return [made[number] for number in sorted(made)]


def _draw_samples(
    cells: Sequence[CellConfig], seed: int, numbers: range, scene: SceneConfig | None = None
) -> Iterator[tuple[int, str, Sample]]:
    """Yield number, camera and sample of scenes of all cells in turn; widely varied if `scene` is None."""
    cv2.setNumThreads(1)
    cameras = [next(iter(cell.cameras)) for cell in cells]
    with contextlib.ExitStack() as stack:
        renderers = [
            SceneRenderer(cell, camera, randomized=scene is None, scene=scene or DECLARED_SCENE)
            for cell, camera in zip(cells, cameras, strict=True)
        ]
        for renderer in renderers:
            stack.callback(renderer.close)
        for number in numbers:
            cell_index = number % len(cells)
            sample_seed = int(np.random.SeedSequence([seed, number]).generate_state(1, np.uint64)[0])
            yield number, cameras[cell_index], renderers[cell_index].render_sample(sample_seed)


def _render_block(
    cells: Sequence[CellConfig], out: Path, layout: str, seed: int, first_valid: int, numbers: range
) -> dict[int, DatasetEntry]:
    """Render and save the images with these numbers, in a worker process."""
    entries = {}
    for number, camera, sample in _draw_samples(cells, seed, numbers):
        split, file = "train" if number < first_valid else "valid", f"{camera}_{number:06d}.jpg"
        save_image(build_image_path(out, layout, split, file), sample.image)
        entries[number] = _make_entry(sample, split, file, camera)
    return entries


def _render_frames(
    config: CellConfig, scene: SceneConfig, seed: int, numbers: range
) -> dict[int, LabelledImage]:
    """Render the frames with these numbers, in a worker process."""
    samples = _draw_samples([config], seed, numbers, scene)
    return {i: to_labelled_frame(sample, camera, f"{camera}_{i:06d}") for i, camera, sample in samples}


def _make_entry(sample: Sample, split: str, file: str, camera: str) -> DatasetEntry:
    """Return the dataset entry of a sample, with the ground truth for measuring localizers."""
    rounded = {
        "matrix": sample.matrix.tolist(),
        "positions": sample.positions.round(6).tolist(),
        "centres": sample.centres.round(6).tolist(),
        "visible_fraction": sample.visible_fraction.round(4).tolist(),
    }
    boxes, ignored = _to_boxes(sample.boxes), _to_boxes(sample.ignored)
    truth = {**_collect_truth(sample, camera, sample.region), **rounded}
    return DatasetEntry(split, file, (IMAGE_SIZE, IMAGE_SIZE), sample.labels, boxes, ignored, truth)


def to_labelled_frame(sample: Sample, camera: str, file: str) -> LabelledImage:
    """Return the full frame of a sample of an initial scene; `sample.image` is a scaled part of it."""
    assert sample.frame is not None
    height, width = sample.frame.shape[:2]
    left, top, right, _ = sample.region
    scale, corner = (right - left) / IMAGE_SIZE, [left, top, left, top]
    return LabelledImage(
        file=file,
        image=sample.frame,
        labels=sample.labels,
        boxes=_to_boxes(sample.boxes * scale + corner),
        ignored=_to_boxes(sample.ignored * scale + corner),
        truth=_collect_truth(sample, camera, (0, 0, width, height)),
        region=sample.region,
        depth=sample.depth,
        second_image=sample.second_frame,
    )


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
    return tuple((left, top, right, bottom) for left, top, right, bottom in boxes.tolist())
