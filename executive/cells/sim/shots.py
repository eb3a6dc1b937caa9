"""Pictures of a recorded world, rendered during its reconstruction in several processes."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

from executive.cell.config import CellConfig
from executive.cells.sim.camera import Image, Light, Render, render
from executive.cells.sim.command_log import RUN_STEP, read_commands
from executive.cells.sim.rebuild import WorldRebuilder
from executive.cells.sim.scene_file import load_scene
from executive.cells.sim.spawn import build_initial_world
from executive.cells.sim.tool import SuctionTool
from executive.cells.sim.viewpoint import Viewpoint
from executive.processes import WorkerPool

FILM_LIGHT = Light(direction=(0.5, -0.6, 1.2), ambient=0.6, diffuse=0.4, shadow=True)
"""Light with contrast between objects: from the right, with shadows."""
SKY, GROUND = (226, 231, 237), (172, 182, 194)
"""Colours of the background at the top and at the bottom, RGB, each 0 to 255."""
MIN_EDGE_CONTRAST = 24
"""Smallest difference in brightness between neighbouring pixels at an edge, of 255."""
PICTURES_PER_BLOCK = 24
"""Number of pictures per block; each block has a world of its own and repeats all earlier commands."""
PICTURES_IN_FIRST_BLOCK = 2
"""Number of pictures of the first block, which is small so that the first picture is early."""


@dataclass(frozen=True, eq=False)
class Shoot:
    """Run and viewpoint of pictures.

    Attributes:
        config: The cell file of the run.
        seed: Seed of the run.
        log: Command log of the world.
        viewpoint: Viewpoint of the pictures.
        scene: Scene file of the run, or None. Its light does not affect the pictures.
    """

    config: CellConfig
    seed: int
    log: Path
    viewpoint: Viewpoint
    scene: Path | None = None


def count_steps(log: Path) -> int:
    """Return the number of control steps of a run in the command log of its world.

    Raises:
        InputError: There is no such log.
    """
    return sum(command.kind == RUN_STEP for command in read_commands(log))


def take_pictures(shoot: Shoot, steps: Sequence[int], workers: int) -> Generator[Image, None, None]:
    """Yield pictures `(h, w, 3)` uint8 RGB of the world after the given control steps of the run, in order.

    Args:
        shoot: Run and viewpoint.
        steps: Numbers of control steps, ascending.
        workers: Number of processes.
    """
    bounds = [0, *range(PICTURES_IN_FIRST_BLOCK, len(steps), PICTURES_PER_BLOCK), len(steps)]
    blocks = [steps[first:end] for first, end in pairwise(bounds)]
    with WorkerPool(workers) as pool:
        pending: deque[Future[list[Image]]] = deque()
        # The number of pending blocks is limited, because waiting pictures occupy memory.
        for block in blocks:
            pending.append(pool.submit(_take, shoot, block))
            if len(pending) > workers:
                yield from pending.popleft().result()
        while pending:
            yield from pending.popleft().result()


def _take(shoot: Shoot, steps: Sequence[int]) -> list[Image]:
    """Return the pictures after these steps; runs in a process of its own."""
    return list(take_pictures_in_order(shoot, steps))


def take_pictures_in_order(shoot: Shoot, steps: Sequence[int]) -> Iterator[Image]:
    """Yield the pictures of `take_pictures`, rendered in one world in this process."""
    scene = load_scene(shoot.scene, shoot.config)
    world, viewpoint = build_initial_world(shoot.config, shoot.seed, scene=scene), shoot.viewpoint
    try:
        # The distracting pattern of the floor is hidden: transparent bodies are not rendered.
        world.client.changeVisualShape(world.floor, -1, rgbaColor=[1, 1, 1, 0])
        rebuilder = WorldRebuilder(world, SuctionTool(world, shoot.config.tool))
        commands = read_commands(shoot.log)
        done = 0
        for step in steps:
            while done < step:
                command = next(commands)
                rebuilder.execute(command)
                done += command.kind == RUN_STEP
            yield _compose_picture(
                render(world, viewpoint.matrix, viewpoint.X_WC, (0, 0, *viewpoint.size), FILM_LIGHT)
            )
    finally:
        world.close()


def _compose_picture(rendered: Render) -> Image:
    """Return a rendered image with a background and smooth edges; the renderer has no antialiasing."""
    height = len(rendered.image)
    share = np.linspace(0, 1, height)[:, None, None]
    backdrop = (1 - share) * np.array(SKY) + share * np.array(GROUND)
    empty = rendered.bodies == -1
    image = np.where(empty[..., None], np.rint(backdrop).astype(np.uint8), rendered.image)
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    square = np.ones((3, 3), np.uint8)
    edge = cv2.dilate(grey, square).astype(np.int16) - cv2.erode(grey, square) > MIN_EDGE_CONTRAST
    return np.asarray(np.where(edge[..., None], cv2.GaussianBlur(image, (3, 3), 0), image))
