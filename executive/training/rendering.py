"""Data sets and frames of labelled scenes: rendered in parallel, the same for any number of workers."""

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
from executive.processes import Workers
from executive.training.dataset import DatasetEntry, build_image_path, save_image, write_annotations
from executive.training.labelled_image import LabelledImage

T = TypeVar("T")
Progress = Callable[[int, int], None]
"""Takes the number of images made so far, and of all."""
BLOCK = 40
"""Number of samples that a worker makes before it reports, with one world per cell."""


def generate(
    configs: Mapping[str, CellConfig],
    out: Path,
    *,
    images: int,
    seed: int,
    layout: str,
    workers: int,
    valid: float,
    progress: Progress,
) -> None:
    """Write a dataset of random scenes, the cells taking turns; the last share of it is for validation.

    Args:
        configs: Cells by name.
        out: Folder of the dataset.
        images: Number of images.
        seed: Seed; with the same cells it gives the same dataset for any number of workers.
        layout: `coco` or `yolo`.
        workers: Processes that render.
        valid: Share of the images that goes into the split `valid`, 0 to 1.
        progress: Called now and then.

    Raises:
        InputError: The layout is unknown, the cells differ in their classes, a model is missing or not as
            large as its cell says, or a file cannot be written.
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
    render = partial(_render_block, cells, out, layout, seed, images - round(images * valid))
    write_annotations(out, layout, _in_blocks(render, images, workers, progress), classes)


def run_frames(
    config: CellConfig,
    *,
    images: int,
    seed: int,
    workers: int,
    progress: Progress,
    scene: SceneConfig = DECLARED_SCENE,
) -> list[LabelledImage]:
    """Return whole frames of a cell's camera, each of another scene that a run may begin with.

    They are labelled in the camera's view `table`.

    Args:
        config: The cell.
        images: Number of frames.
        seed: Seed; with the same cell it gives the same frames for any number of workers.
        workers: Processes that render.
        progress: Called now and then.
        scene: Changes the world without the cell's knowledge.
    """
    return _in_blocks(partial(_take_frames, config, scene, seed), images, workers, progress)


def _in_blocks(
    make: Callable[[range], dict[int, T]], count: int, workers: int, progress: Progress
) -> list[T]:
    """Return items 0 to `count` - 1, which `make` makes block by block in processes, by their numbers."""
    made: dict[int, T] = {}
    with Workers(workers) as pool:
        starts = range(0, count, BLOCK)
        blocks = [pool.submit(make, range(first, min(first + BLOCK, count))) for first in starts]
        for block in as_completed(blocks):
            made.update(block.result())
            progress(len(made), count)
    return [made[number] for number in sorted(made)]


def _draw(
    cells: Sequence[CellConfig], seed: int, numbers: range, scene: SceneConfig | None = None
) -> Iterator[tuple[int, str, Sample]]:
    """Yield number, camera and sample of scenes of the cells, which take turns; varied without `scene`."""
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
            turn = number % len(cells)
            sample_seed = int(np.random.SeedSequence([seed, number]).generate_state(1, np.uint64)[0])
            yield number, cameras[turn], renderers[turn].sample(sample_seed)


def _render_block(
    cells: Sequence[CellConfig], out: Path, layout: str, seed: int, first_valid: int, numbers: range
) -> dict[int, DatasetEntry]:
    """Render and save the images of these numbers; runs in a process of its own."""
    entries = {}
    for number, camera, sample in _draw(cells, seed, numbers):
        split, file = "train" if number < first_valid else "valid", f"{camera}_{number:06d}.jpg"
        save_image(build_image_path(out, layout, split, file), sample.image)
        entries[number] = _entry(sample, split, file, camera)
    return entries


def _take_frames(
    config: CellConfig, scene: SceneConfig, seed: int, numbers: range
) -> dict[int, LabelledImage]:
    """Take the frames of these numbers; runs in a process of its own."""
    drawn = _draw([config], seed, numbers, scene)
    return {
        number: as_labelled_frame(sample, camera, f"{camera}_{number:06d}")
        for number, camera, sample in drawn
    }


def _entry(sample: Sample, split: str, file: str, camera: str) -> DatasetEntry:
    """Return the dataset entry of a sample, with the truth for measuring localizers."""
    rounded = {
        "matrix": sample.matrix.tolist(),
        "positions": sample.positions.round(6).tolist(),
        "centres": sample.centres.round(6).tolist(),
        "visible_fraction": sample.visible_fraction.round(4).tolist(),
    }
    boxes, ignored = _boxes(sample.boxes), _boxes(sample.ignored)
    truth = {**_truth(sample, camera, sample.part), **rounded}
    return DatasetEntry(split, file, (IMAGE_SIZE, IMAGE_SIZE), sample.labels, boxes, ignored, truth)


def as_labelled_frame(sample: Sample, camera: str, file: str) -> LabelledImage:
    """Return the whole frame from which a sample of an initial scene of a run was cut."""
    assert sample.frame is not None
    height, width = sample.frame.shape[:2]
    left, top, right, _ = sample.part
    scale, corner = (right - left) / IMAGE_SIZE, [left, top, left, top]
    return LabelledImage(
        file=file,
        image=sample.frame,
        labels=sample.labels,
        boxes=_boxes(sample.boxes * scale + corner),
        ignored=_boxes(sample.ignored * scale + corner),
        truth=_truth(sample, camera, (0, 0, width, height)),
        region=sample.part,
        depth=sample.depth,
        second_image=sample.second,
    )


def _truth(sample: Sample, camera: str, part: Box) -> dict[str, Any]:
    """Return the renderer's knowledge about an image that shows `part` of the camera's image."""
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


def _boxes(boxes: Array) -> tuple[Box, ...]:
    return tuple((left, top, right, bottom) for left, top, right, bottom in boxes.tolist())
