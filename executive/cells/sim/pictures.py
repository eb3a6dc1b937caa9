"""Pictures of the world of a recorded run: their viewpoint, and rendering in several processes."""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Generator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from executive.cell.config import CellConfig
from executive.cell.frame import Box
from executive.cells.sim.command_log import RUN_STEP, read_commands
from executive.cells.sim.rebuild import WorldRebuilder
from executive.cells.sim.renderer import Image, Light, RenderedImage, render
from executive.cells.sim.scene_file import load_scene
from executive.cells.sim.spawn import build_initial_world
from executive.cells.sim.tool import SuctionTool
from executive.geometry import Array, Pose
from executive.perception.camera_model import compute_camera_matrix, compute_look_at_pose
from executive.processes import WorkerPool

CAMERA_AZIMUTH, CAMERA_ELEVATION = math.radians(-37), math.radians(29)
"""Direction from the cell to the camera [rad]: in front of the arm, to the right, and above."""
FIELD_OF_VIEW_DEG = 33.0
"""Vertical field of view of the camera [degree]; a small value reduces perspective distortion."""
ARM_HEIGHT = 0.8
"""Height of the arm above its base for the choice of the viewpoint [m]."""
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
class Viewpoint:
    """Virtual camera of a rendered image.

    Attributes:
        matrix: Camera matrix `(3, 3)` [pixel].
        X_WC: Pose of the camera in the world.
        size: Width and height of the image [pixel].
    """

    matrix: Array
    X_WC: Pose
    size: tuple[int, int]


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


def compute_viewpoint(config: CellConfig, size: tuple[int, int], region: Box) -> Viewpoint:
    """Return the viewpoint from which arm, workspace and bins of a cell fill a region of the image.

    Args:
        config: The cell file.
        size: Width and height of the image [pixel].
        region: Left, top, right and bottom of the region [pixel].
    """
    matrix = compute_camera_matrix(*size, FIELD_OF_VIEW_DEG)
    x, y = (math.cos(CAMERA_ELEVATION) * function(CAMERA_AZIMUTH) for function in (math.cos, math.sin))
    R_WC = compute_look_at_pose([x, y, math.sin(CAMERA_ELEVATION)], [0, 0, 0], [0, 0, 1]).rotation
    points = _list_hull_points(config) @ R_WC
    # In camera axes, low and high are the slopes of the rays through the corners of the region. A camera at p
    # shows a point q in the region if low (q_z - p_z) <= q_x - p_x <= high (q_z - p_z), and likewise for y.
    # The largest possible p_z is chosen, then the mean of the possible p_x and p_y.
    corners = np.array([[*region[:2], 1.0], [*region[2:], 1.0]]).T
    low, high = np.linalg.solve(matrix, corners).T[:, :2]
    lower = np.max(points[:, :2] - high * points[:, 2:], axis=0)
    upper = np.min(points[:, :2] - low * points[:, 2:], axis=0)
    z = np.min((upper - lower) / (high - low))
    xy = (lower + high * z + upper + low * z) / 2
    return Viewpoint(matrix, Pose(R_WC, R_WC @ np.array([*xy, z])), size)


def _list_hull_points(config: CellConfig) -> Array:
    """Return points in the world `(N, 3)` [m] whose convex hull contains arm, workspace and bins."""
    points = [(0.0, 0.0, 0.0), (0.0, 0.0, ARM_HEIGHT)]
    points += itertools.product(config.table.x, config.table.y, (0.0,))
    for bin in config.bins.values():
        (x, y, z), (length, width, height) = bin.position, bin.size
        xs, ys = (x - length / 2, x + length / 2), (y - width / 2, y + width / 2)
        points += itertools.product(xs, ys, (z + height,))
    return np.array(points)


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
    blocks = [steps[start:end] for start, end in itertools.pairwise([0, *starts, len(steps)])]
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
