"""Data sets of labelled scenes: rendered in parallel, the same whatever the number of workers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import as_completed
from pathlib import Path

import cv2
import numpy as np

from executive.cell_config import CellConfig
from executive.errors import InputError
from executive.geometry import Array
from executive.messages import Box
from executive.sim.models import missing_models
from executive.sim.scenes import SIZE, Sample, SceneRenderer
from executive.vision.dataset import Entry, image_path, save_image, write_annotations
from executive.workers import Workers

BLOCK = 40
"""Samples that a worker makes before it reports, with one world per cell."""


def generate(
    configs: Mapping[str, CellConfig],
    out: Path,
    *,
    images: int,
    seed: int,
    layout: str,
    workers: int,
    valid: float,
    progress: Callable[[int, int], None],
) -> None:
    """Write a dataset of random scenes, the cells taking turns; the last share of it is for validation.

    Args:
        configs: Cells by name.
        out: Folder of the dataset.
        images: How many images.
        seed: Seed; with the same cells it gives the same dataset, whatever the number of workers.
        layout: `coco` or `yolo`.
        workers: Processes that render.
        valid: Share of the images that goes into the split `valid`, 0 to 1.
        progress: Told (images made, images in all) now and then.

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
        for key, sentence in missing_models(cell):
            raise InputError(f"{name}: {'.'.join(map(str, key))}: {sentence}")
    first_valid = images - round(images * valid)
    splits = ["train" if number < first_valid else "valid" for number in range(images)]
    write_annotations(out, layout, [], classes)
    entries: dict[int, Entry] = {}
    with Workers(workers) as pool:
        blocks = [
            pool.submit(_render_block, cells, out, layout, seed, first, splits[first : first + BLOCK])
            for first in range(0, images, BLOCK)
        ]
        for block in as_completed(blocks):
            entries.update(block.result())
            progress(len(entries), images)
    write_annotations(out, layout, [entries[number] for number in sorted(entries)], classes)


def _render_block(
    cells: Sequence[CellConfig],
    out: Path,
    layout: str,
    seed: int,
    first: int,
    splits: Sequence[str],
) -> dict[int, Entry]:
    """Render and save the images from number `first` on, one per split; runs in a process of its own."""
    cv2.setNumThreads(1)
    cameras = [next(iter(cell.cameras)) for cell in cells]
    renderers = [SceneRenderer(cell, camera) for cell, camera in zip(cells, cameras, strict=True)]
    entries = {}
    for number, split in enumerate(splits, first):
        turn = number % len(cells)
        sample_seed = int(np.random.SeedSequence([seed, number]).generate_state(1, np.uint64)[0])
        sample = renderers[turn].sample(sample_seed)
        file = f"{cameras[turn]}_{number:06d}.jpg"
        save_image(image_path(out, layout, split, file), sample.image)
        entries[number] = _entry(sample, split, file, cameras[turn])
    for renderer in renderers:
        renderer.close()
    return entries


def _entry(sample: Sample, split: str, file: str, camera: str) -> Entry:
    """Return the dataset entry of a sample, with what a localization can be measured against."""
    return Entry(
        split=split,
        file=file,
        size=(SIZE, SIZE),
        labels=sample.labels,
        boxes=_tuples(sample.boxes),
        ignored=_tuples(sample.ignored),
        truth={
            "camera": camera,
            "part": sample.part,
            "matrix": sample.matrix.tolist(),
            "X_WC": sample.X_WC.rounded(9),
            "labels": sample.labels,
            "positions": sample.positions.round(6).tolist(),
            "centres": sample.centres.round(6).tolist(),
            "visible_fraction": sample.visible_fraction.round(4).tolist(),
        },
    )


def _tuples(boxes: Array) -> tuple[Box, ...]:
    return tuple((float(left), float(top), float(right), float(bottom)) for left, top, right, bottom in boxes)
