"""Random labelled scenes of a cell, for training and measuring detectors.

A sample is a function of cell file, camera and seed alone. Labels are amodal and sub-pixel: the box
of an object's whole silhouette, computed from its mesh, also where something hides a part of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell.config import CellConfig, NoiseConfig
from executive.cell.frame import Box
from executive.cells.audit import UNKNOWN
from executive.cells.sim.arrangements import SceneObject, arrange, make_held_object, move_arm, random_part
from executive.cells.sim.camera import CELL_LIGHT, Image, add_depth_noise, add_noise, get_camera_pose, render
from executive.cells.sim.models import load_mesh
from executive.cells.sim.scene_file import DECLARED_SCENE, SceneConfig
from executive.cells.sim.scene_world import build_light, paint_table, true_cell
from executive.cells.sim.silhouette import compute_bounding_box, compute_visible_fraction
from executive.cells.sim.spawn import spawn
from executive.cells.sim.table_top import WOOD
from executive.cells.sim.variations import (
    WOOD_COLOUR,
    random_camera,
    random_light,
    random_noise,
    random_table,
)
from executive.cells.sim.world import World
from executive.errors import InputError
from executive.geometry import Array, Pose
from executive.perception.camera_model import compute_calibration, intersect_plane, project

IMAGE_SIZE = 256
"""Side of a sample's image [pixel]: what a detector is given."""
MIN_LABELLED_SHARE = 0.5
"""Share of its silhouette that must be visible for an object to be labelled."""
MAX_HIDDEN_SHARE = 0.15
"""Share under which an object counts as hidden; in between it is neither labelled nor background."""
MAX_IGNORED_SHARE = 1 / 6
"""Share of the objects that may lie between the two, but always one: more would confuse training."""
MAX_ATTEMPTS = 50
"""Number of random scenes after which a lack of room for the objects is an error."""
DECLARED_SHARE = 0.2
"""Share of the scenes with table, lamp, camera and noise as in the cell file."""
MIN_CONTRAST = 5
"""Contrast to its surroundings under which an object is ignored [standard deviation of the noise]."""


@dataclass(frozen=True, eq=False)
class Sample:
    """A labelled image.

    Attributes:
        image: `(SIZE, SIZE, 3)` uint8, RGB.
        labels: Class of each labelled object.
        boxes: Their boxes `(N, 4)` [pixel] in `image`, clipped to it.
        visible_fraction: Visible share of each `(N,)`, 0 to 1.
        positions: Where the centre of each whole silhouette's box meets the height of the object's
            middle `(N, 3)` [m] in the world: what a perfect detector would be localized to.
        centres: Middle of each object's extents `(N, 3)` [m] in the world.
        ignored: Boxes `(M, 4)` of objects too hidden to be labelled and too visible to be background.
        part: Part of the camera's image shown (left, top, right, bottom [pixel]).
        matrix: Camera matrix of the whole image; of a scene as a run begins with, the declared one.
        X_WC: Where the camera was, likewise.
        frame: The camera's whole image `(H, W, 3)`, of a scene as a run begins with.
        depth: What its depth sensor gives `(H, W)` [m], likewise; None without one.
        second: Whole image `(H, W, 3)` of the same scene with other noise, likewise.
    """

    image: Image
    labels: tuple[str, ...]
    boxes: Array
    visible_fraction: Array
    positions: Array
    centres: Array
    ignored: Array
    part: tuple[int, int, int, int]
    matrix: Array
    X_WC: Pose
    frame: Image | None = None
    depth: Array | None = None
    second: Image | None = None


@dataclass(frozen=True, eq=False)
class SceneView:
    """A part of a camera's image, free of noise.

    Attributes:
        image: `(h, w, 3)` uint8, RGB.
        bodies: `(h, w)` body at each pixel.
        part: Left, top, right and bottom [pixel] in the whole image.
        matrix: Camera matrix of the whole image.
        X_WC: Pose of the camera.
        noise: Noise in which an object must be visible to be labelled.
    """

    image: Image
    bodies: NDArray[np.int32]
    part: tuple[int, int, int, int]
    matrix: Array
    X_WC: Pose
    noise: NoiseConfig


class SceneRenderer:
    """Makes samples of one camera of a cell, reusing one world for all of them.

    With `randomized`, everything varies more than a run can: for training. Without, scenes are as a run
    begins with: objects set down by `spawn`, the lamp of `scene`, the arm at one of the scan poses.
    """

    def __init__(
        self, config: CellConfig, camera: str, *, randomized: bool = True, scene: SceneConfig = DECLARED_SCENE
    ) -> None:
        self._randomized = randomized
        self._scene = scene
        self._declared = config.cameras[camera]
        self._config = true_cell(config, scene)
        self._camera = self._config.cameras[camera]
        self._world = World(self._config)
        paint_table(self._world, scene)
        self._matrix, _ = compute_calibration(self._camera)

    def sample(self, seed: int) -> Sample:
        """Return the sample of `seed`: the first of its random scenes with few half-hidden objects.

        Raises:
            InputError: The workspace has no room for the objects.
        """
        attempt = 0
        while True:
            rng = np.random.default_rng([seed, attempt])
            attempt += 1
            try:
                sample = self._draw(rng) if self._randomized else self._draw_as_run(rng)
            except InputError:
                # So many objects fit in some scenes and not in others.
                if attempt == MAX_ATTEMPTS:
                    raise
                continue
            if sample is not None:
                return sample

    def close(self) -> None:
        """Give the world back."""
        self._world.close()

    def _draw(self, rng: np.random.Generator) -> Sample | None:
        world = self._world
        holds = move_arm(world, self._camera, rng)
        matrix, X_WC = self._matrix, get_camera_pose(world, self._camera)
        (colour, texture), light, noise = ((1.0, 1.0, 1.0), WOOD), CELL_LIGHT, self._camera.noise
        if rng.random() >= DECLARED_SHARE:
            matrix, X_WC = random_camera(self._camera, matrix, X_WC, rng)
            (colour, texture), light = random_table(rng), random_light(rng)
            noise = random_noise(noise, rng)
        part = random_part(self._camera, rng)
        shown = colour if texture != WOOD else tuple(np.multiply(colour, WOOD_COLOUR).tolist())
        corners = [(x, y) for x in part[::2] for y in part[1::2]]
        footprint = np.array([intersect_plane(matrix, X_WC, corner, 0.0)[:2] for corner in corners])
        items = arrange(self._config, footprint, part == self._camera.table_view, shown, rng)
        if holds:
            items.append(make_held_object(world.get_tool_pose(), self._config, rng))
        bodies = [world.add_object(item.label, item.X_WO, item.colour, item.model) for item in items]
        with _removing(world, bodies):
            world.table_top.paint(colour, texture)
            shot = render(world, matrix, X_WC, part, light)
        view = SceneView(shot.image, shot.bodies, part, matrix, X_WC, noise)
        sample = self._label(view, bodies, items)
        return None if sample is None else replace(sample, image=_resize(add_noise(shot.image, noise, rng)))

    def _draw_as_run(self, rng: np.random.Generator) -> Sample | None:
        world, camera = self._world, self._camera
        pose = np.radians(self._config.arm.poses_deg[str(rng.choice(camera.scan_poses))])
        world.set_joint_positions(pose)
        bodies = spawn(world, self._config, int(rng.integers(2**32)), unknown=self._scene.unknown)
        world.set_joint_positions(pose)  # settling may have let it sag
        with _removing(world, bodies):
            X_WC, declared = get_camera_pose(world, camera), get_camera_pose(world, self._declared)
            items = [
                SceneObject(
                    world.bodies[body], world.models[body], world.get_object_pose(body), (0.0, 0.0, 0.0)
                )
                for body in bodies
            ]
            whole, light = (0, 0, camera.width, camera.height), build_light(self._scene.light)
            shot = render(world, self._matrix, X_WC, whole, light)
        frame = add_noise(shot.image, camera.noise, rng)
        depth = None if camera.depth is None else add_depth_noise(shot.depth, camera.depth, rng)
        second = add_noise(shot.image, camera.noise, rng)
        left, top, right, bottom = part = camera.table_view
        clean, seen = shot.image[top:bottom, left:right], shot.bodies[top:bottom, left:right]
        # By the declared noise: more noise in a scene does not excuse a detector from finding an object.
        view = SceneView(clean, seen, part, self._matrix, X_WC, self._declared.noise)
        sample = self._label(view, bodies, items)
        if sample is None:
            return None
        # A run takes the camera for what the cell file declares.
        sample = replace(sample, matrix=compute_calibration(self._declared)[0], X_WC=declared)
        image = _resize(frame[top:bottom, left:right])
        return replace(sample, image=image, frame=frame, depth=depth, second=second)

    def _label(self, view: SceneView, bodies: Sequence[int], items: Sequence[SceneObject]) -> Sample | None:
        """Label a render, or return None if too many objects are half hidden."""
        labelled: list[tuple[str, list[float], float, Array, Array]] = []
        ignored, half_hidden = [], 0
        corner, scale = np.array(view.part[:2], dtype=float), IMAGE_SIZE / (view.part[2] - view.part[0])
        for body, item in zip(bodies, items, strict=True):
            mine = view.bodies == body
            if item.label == UNKNOWN or not mine.any():
                continue
            mesh = load_mesh(item.model)
            vertices = item.X_WO.apply(mesh.vertices)
            pixels = project(view.matrix, view.X_WC, vertices)
            share = compute_visible_fraction(mesh, pixels, mine)
            whole = compute_bounding_box(pixels)
            box = _clip(whole, corner, scale)
            if share < MAX_HIDDEN_SHARE:
                continue
            half_hidden += share < MIN_LABELLED_SHARE
            if (
                share < MIN_LABELLED_SHARE
                or measure_contrast(view.image, mine) < MIN_CONTRAST * view.noise.read
            ):
                ignored.append(box)
                continue
            centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
            middle = ((whole[0] + whole[2]) / 2, (whole[1] + whole[3]) / 2)
            position = intersect_plane(view.matrix, view.X_WC, middle, float(centre[2]))
            labelled.append((item.label, box, share, position, centre))
        if half_hidden > max(1, len(items) * MAX_IGNORED_SHARE):
            return None
        return Sample(
            image=view.image,
            labels=tuple(label for label, *_ in labelled),
            boxes=np.array([box for _, box, *_ in labelled]).reshape(-1, 4),
            visible_fraction=np.array([share for *_, share, _, _ in labelled]),
            positions=np.array([position for *_, position, _ in labelled]).reshape(-1, 3),
            centres=np.array([centre for *_, centre in labelled]).reshape(-1, 3),
            ignored=np.array(ignored).reshape(-1, 4),
            part=view.part,
            matrix=view.matrix,
            X_WC=view.X_WC,
        )


@contextmanager
def _removing(world: World, bodies: Sequence[int]) -> Iterator[None]:
    """Remove bodies from the world at the end of the context."""
    try:
        yield
    finally:
        for body in bodies:
            world.remove_object(body)


def measure_contrast(image: Image, mask: NDArray[np.bool_]) -> float:
    """Return the difference between an object and a ring of two pixels around it [grey level].

    It is the largest of the three colours, and the median over the pixels of the object.

    Args:
        image: `(H, W, 3)`.
        mask: The pixels `(H, W)` that show the object.
    """
    ring = cv2.dilate(mask.astype(np.uint8), np.ones((5, 5), np.uint8)).astype(bool) & ~mask
    if not ring.any():
        return 0.0
    around = np.median(image[ring], axis=0)
    return float(np.median(np.abs(image[mask] - around).max(axis=1)))


def _clip(box: Box, corner: Array, scale: float) -> list[float]:
    """Return a box of the whole image in a sample's pixels, cut at its edges."""
    points = (np.array(box).reshape(2, 2) - corner) * scale
    return [float(value) for value in points.clip(0, IMAGE_SIZE).ravel()]


def _resize(image: Image) -> Image:
    if image.shape[0] == IMAGE_SIZE:
        return image
    return np.asarray(
        cv2.resize(image, (IMAGE_SIZE, IMAGE_SIZE), interpolation=cv2.INTER_AREA), dtype=np.uint8
    )
