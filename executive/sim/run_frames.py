"""Frames of the scenes that runs begin with, as the run's camera takes them, and what is on them."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import as_completed

import cv2
import numpy as np

from executive.cell_config import CellConfig
from executive.messages import Box
from executive.sim.scenes import SIZE, Sample, SceneRenderer
from executive.vision.samples import LabelledImage
from executive.workers import Workers

BLOCK = 20
"""Frames that a worker takes before it reports, in one world."""


def run_frames(
    config: CellConfig,
    *,
    images: int,
    seed: int,
    workers: int,
    progress: Callable[[int, int], None],
) -> list[LabelledImage]:
    """Return whole frames of a cell's camera, each of a scene of its own, labelled in its view `table`.

    Args:
        config: The cell.
        images: How many.
        seed: Seed; with the same cell it gives the same frames, whatever the number of workers.
        workers: Processes that render.
        progress: Told (frames taken, frames in all) now and then.
    """
    frames: dict[int, LabelledImage] = {}
    with Workers(workers) as pool:
        blocks = [
            pool.submit(_take, config, seed, range(first, min(first + BLOCK, images)))
            for first in range(0, images, BLOCK)
        ]
        for block in as_completed(blocks):
            frames.update(block.result())
            progress(len(frames), images)
    return [frames[number] for number in sorted(frames)]


def _take(config: CellConfig, seed: int, numbers: range) -> dict[int, LabelledImage]:
    """Take the frames of these numbers; runs in a process of its own."""
    cv2.setNumThreads(1)
    camera = next(iter(config.cameras))
    renderer = SceneRenderer(config, camera, randomized=False)
    try:
        frames = {}
        for number in numbers:
            sample_seed = int(np.random.SeedSequence([seed, number]).generate_state(1, np.uint64)[0])
            frames[number] = as_labelled_frame(renderer.sample(sample_seed), camera, f"{camera}_{number:06d}")
        return frames
    finally:
        renderer.close()


def as_labelled_frame(sample: Sample, camera: str, file: str) -> LabelledImage:
    """Return the whole frame that a sample as a run begins with was cut from."""
    assert sample.frame is not None
    height, width = sample.frame.shape[:2]
    left, top, right, bottom = sample.part

    def boxes(cut: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> tuple[Box, ...]:
        whole = cut * ((right - left) / SIZE) + [left, top, left, top]
        return tuple((box[0], box[1], box[2], box[3]) for box in whole.tolist())

    return LabelledImage(
        file=file,
        image=sample.frame,
        labels=sample.labels,
        boxes=boxes(sample.boxes),
        ignored=boxes(sample.ignored),
        truth={
            "camera": camera,
            "part": (0, 0, width, height),
            "matrix": sample.matrix,
            "X_WC": sample.X_WC.rounded(9),
            "positions": sample.positions,
            "centres": sample.centres,
            "visible_fraction": sample.visible_fraction,
        },
        area=(left, top, right, bottom),
        depth=sample.depth,
    )
