"""Pictures of a recorded world, taken while it is rebuilt, in several processes."""

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
from executive.cells.sim.command_log import STEP, read_commands
from executive.cells.sim.rebuild import Rebuilding
from executive.cells.sim.scene_file import load_scene
from executive.cells.sim.spawn import first_world
from executive.cells.sim.tool import SuctionTool
from executive.cells.sim.viewpoint import Viewpoint
from executive.processes import Workers

FILM_LIGHT = Light(direction=(0.5, -0.6, 1.2), ambient=0.6, diffuse=0.4, shadow=True)
"""A lamp that lets things stand out from each other: from the right, and with shadows."""
SKY, GROUND = (226, 231, 237), (172, 182, 194)
"""Colours at the top and at the bottom of what is behind the cell, RGB."""
MIN_EDGE_CONTRAST = 24
"""Difference of brightness between neighbours from which there is an edge, of 255."""
PICTURES_PER_BLOCK = 24
"""Pictures that a process takes in one world; each block does again what was done before it."""
PICTURES_IN_FIRST_BLOCK = 2
"""Pictures of the first block, so that the first picture comes soon."""


@dataclass(frozen=True, eq=False)
class Shoot:
    """What pictures are taken of.

    Attributes:
        config: The cell.
        seed: That of the run.
        log: What was done to its world.
        viewpoint: Where it is looked at from.
        scene: The scene file of the run, or None. Its light is the cameras' alone.
    """

    config: CellConfig
    seed: int
    log: Path
    viewpoint: Viewpoint
    scene: Path | None = None


def count_steps(log: Path) -> int:
    """Return how many control steps of a run the log of its world tells of.

    Raises:
        InputError: There is no such log.
    """
    return sum(command.kind == STEP for command in read_commands(log))


def take_pictures(shoot: Shoot, steps: Sequence[int], workers: int) -> Generator[Image, None, None]:
    """Yield pictures `(h, w, 3)` uint8 RGB of the world after so many control steps of the run, in order.

    Args:
        shoot: What they are taken of.
        steps: After how many steps, ascending.
        workers: Processes that take them.
    """
    bounds = [0, *range(PICTURES_IN_FIRST_BLOCK, len(steps), PICTURES_PER_BLOCK), len(steps)]
    blocks = [steps[first:end] for first, end in pairwise(bounds)]
    with Workers(workers) as pool:
        under_way: deque[Future[list[Image]]] = deque()
        # No more at a time than keeps everybody busy: pictures that nobody fetches yet fill the memory.
        for block in blocks:
            under_way.append(pool.submit(_take, shoot, block))
            if len(under_way) > workers:
                yield from under_way.popleft().result()
        while under_way:
            yield from under_way.popleft().result()


def _take(shoot: Shoot, steps: Sequence[int]) -> list[Image]:
    """Take the pictures after these steps; runs in a process of its own."""
    return list(take_pictures_in_order(shoot, steps))


def take_pictures_in_order(shoot: Shoot, steps: Sequence[int]) -> Iterator[Image]:
    """Yield the pictures of `take_pictures`, taken in one world in this process."""
    scene = load_scene(shoot.scene, shoot.config)
    world, viewpoint = first_world(shoot.config, shoot.seed, scene=scene), shoot.viewpoint
    try:
        # The floor's pattern would draw the eye; what is transparent is not drawn.
        world.client.changeVisualShape(world.plane, -1, rgbaColor=[1, 1, 1, 0])
        rebuilding = Rebuilding(world, SuctionTool(world, shoot.config.tool))
        commands = read_commands(shoot.log)
        done = 0
        for step in steps:
            while done < step:
                command = next(commands)
                rebuilding.do(command)
                done += command.kind == STEP
            yield _picture(
                render(world, viewpoint.matrix, viewpoint.X_WC, (0, 0, *viewpoint.size), FILM_LIGHT)
            )
    finally:
        world.close()


def _picture(rendered: Render) -> Image:
    """Return what was rendered before an even background, its edges smoothed: the renderer leaves steps."""
    height = len(rendered.image)
    share = np.linspace(0, 1, height)[:, None, None]
    backdrop = (1 - share) * np.array(SKY) + share * np.array(GROUND)
    empty = rendered.bodies == -1
    image = np.where(empty[..., None], np.rint(backdrop).astype(np.uint8), rendered.image)
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    square = np.ones((3, 3), np.uint8)
    edge = cv2.dilate(grey, square).astype(np.int16) - cv2.erode(grey, square) > MIN_EDGE_CONTRAST
    return np.asarray(np.where(edge[..., None], cv2.GaussianBlur(image, (3, 3), 0), image))
