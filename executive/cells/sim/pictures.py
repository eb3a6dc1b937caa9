"""Pictures of the world of a recorded run, rendered by several processes with rebuilt worlds."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

from executive.cell.config import CellConfig
from executive.cells.sim.command_log import RUN_STEP, read_commands
from executive.cells.sim.rebuild import WorldRebuilder
from executive.cells.sim.renderer import Image, Light, RenderedImage, render
from executive.cells.sim.scene_file import load_scene
from executive.cells.sim.spawn import build_initial_world
from executive.cells.sim.tool import SuctionTool
from executive.cells.sim.viewpoint import Viewpoint
from executive.processes import WorkerPool

PICTURE_LIGHT = Light(direction=(0.5, -0.6, 1.2), ambient=0.6, diffuse=0.4, shadow=True)
"""Light of the pictures: from the right and with shadows, for contrast between objects."""
TOP_COLOUR, BOTTOM_COLOUR = (226, 231, 237), (172, 182, 194)
"""Colours of the background at the top and at the bottom of a picture, RGB, each 0 to 255."""
MIN_EDGE_CONTRAST = 24
"""Minimum difference in brightness of neighbouring pixels at an edge, 0 to 255."""
MAX_PICTURES_PER_BLOCK = 24
"""Maximum number of pictures in a block; the world is rebuilt from the start of the run for each block."""
MAX_PICTURES_IN_FIRST_BLOCK = 2
"""Maximum number of pictures in the first block, which is small so that the first picture is ready early."""


@dataclass(frozen=True, eq=False)
class PictureSource:
    """Run and viewpoint from which pictures are rendered.

    Attributes:
        config: The cell file of the run.
        seed: Seed of the run.
        log: Command log of the world.
        viewpoint: Viewpoint of the pictures.
        scene: Scene file of the run, or None. The light of the scene does not affect the pictures.
    """

    config: CellConfig
    seed: int
    log: Path
    viewpoint: Viewpoint
    scene: Path | None = None


def count_steps(log: Path) -> int:
    """Return the number of control steps in the command log of a run.

    Raises:
        InputError: The file cannot be read, or is no valid log.
    """
    return sum(command.kind == RUN_STEP for command in read_commands(log))


def render_pictures(
    source: PictureSource, steps: Sequence[int], worker_count: int
) -> Generator[Image, None, None]:
    """Yield pictures `(H, W, 3)` uint8 RGB of the world after the given control steps of the run, in order.

    Args:
        source: Run and viewpoint.
        steps: Numbers of control steps, ascending.
        worker_count: Number of processes.
    """
    starts = range(MAX_PICTURES_IN_FIRST_BLOCK, len(steps), MAX_PICTURES_PER_BLOCK)
    blocks = [steps[start:end] for start, end in pairwise([0, *starts, len(steps)])]
    with WorkerPool(worker_count) as pool:
        pending: deque[Future[list[Image]]] = deque()
        # The number of pending blocks is limited, because their pictures occupy memory.
        for block in blocks:
            pending.append(pool.submit(render_pictures_in_process, source, block))
            if len(pending) > worker_count:
                yield from pending.popleft().result()
        while pending:
            yield from pending.popleft().result()


def render_pictures_in_process(source: PictureSource, steps: Sequence[int]) -> list[Image]:
    """Return pictures `(H, W, 3)` uint8 RGB of the world after the given control steps."""
    scene = load_scene(source.scene, source.config)
    world, viewpoint = build_initial_world(source.config, source.seed, scene=scene), source.viewpoint
    try:
        # The floor is made transparent, so that its pattern is not rendered.
        world.client.changeVisualShape(world.floor, -1, rgbaColor=[1, 1, 1, 0])
        rebuilder = WorldRebuilder(world, SuctionTool(world, source.config.tool))
        commands = read_commands(source.log)
        executed_step_count, pictures = 0, []
        for step in steps:
            while executed_step_count < step:
                command = next(commands)
                rebuilder.execute(command)
                executed_step_count += command.kind == RUN_STEP
            rendered = render(world, viewpoint.matrix, viewpoint.X_WC, (0, 0, *viewpoint.size), PICTURE_LIGHT)
            pictures.append(_compose_picture(rendered))
        return pictures
    finally:
        world.close()


def _compose_picture(rendered: RenderedImage) -> Image:
    """Return a rendered image with a background and blurred edges, because PyBullet has no antialiasing."""
    height = len(rendered.image)
    bottom_weight = np.linspace(0, 1, height)[:, None, None]
    background = (1 - bottom_weight) * np.array(TOP_COLOUR) + bottom_weight * np.array(BOTTOM_COLOUR)
    is_empty = rendered.segmentation == -1
    image = np.where(is_empty[..., None], np.rint(background).astype(np.uint8), rendered.image)
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    is_edge = cv2.morphologyEx(grey, cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8)) > MIN_EDGE_CONTRAST
    return np.asarray(np.where(is_edge[..., None], cv2.GaussianBlur(image, (3, 3), 0), image))
