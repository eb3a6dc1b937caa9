"""Random labelled scenes of a cell, for the training and the evaluation of detectors.

A sample depends only on cell file, camera and seed. Labels are amodal and have subpixel accuracy: the box of
an object is that of its whole silhouette, computed from the mesh, including occluded parts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell.config import CellConfig, NoiseConfig
from executive.cell.frame import Box
from executive.cells.audit import UNKNOWN_LABEL
from executive.cells.sim import arrangements, variations
from executive.cells.sim.arrangements import SceneObject
from executive.cells.sim.camera import (
    CELL_LIGHT,
    Image,
    Region,
    add_depth_noise,
    add_noise,
    get_camera_pose,
    render,
)
from executive.cells.sim.models import load_mesh
from executive.cells.sim.scene_file import DECLARED_SCENE, SceneConfig
from executive.cells.sim.scene_world import build_light, make_true_config, paint_table
from executive.cells.sim.silhouette import compute_bounding_box, compute_visible_fraction
from executive.cells.sim.spawn import spawn_objects
from executive.cells.sim.table_top import WOOD
from executive.cells.sim.world import World
from executive.errors import InputError
from executive.geometry import Array, Pose
from executive.perception.camera_model import compute_calibration, intersect_plane, project

BLACK = (0.0, 0.0, 0.0)
"""Colour of objects whose colour is not used."""
IMAGE_SIZE = 256
"""Side of the image of a sample, as a detector gets it [pixel]."""
MIN_LABELLED_FRACTION = 0.5
"""Minimum visible fraction of the silhouette of a labelled object."""
MIN_VISIBLE_FRACTION = 0.15
"""Visible fraction below which an object counts as background; between both minima, an object is ignored."""
MAX_HALF_OCCLUDED_FRACTION = 1 / 6
"""Maximum fraction of the objects with a visible fraction between both minima; one such object is allowed."""
MAX_ATTEMPTS = 50
"""Number of random scenes after which a lack of room for the objects is an error."""
DECLARED_FRACTION = 0.2
"""Fraction of the scenes with table, lamp, camera and noise as in the cell file."""
MIN_CONTRAST = 5
"""Minimum contrast between a labelled object and its surroundings, in standard deviations of the noise."""


@dataclass(frozen=True, eq=False)
class Sample:
    """A labelled image of a random scene or of the initial scene of a run.

    Attributes:
        image: Image `(IMAGE_SIZE, IMAGE_SIZE, 3)` uint8, RGB.
        labels: Classes of the `N` labelled objects.
        boxes: Boxes of the labelled objects `(N, 4)` [pixel], clipped to `image`.
        visible_fraction: Visible fraction of each labelled object `(N,)`, 0 to 1.
        positions: Points in the world `(N, 3)` [m] at which the ray through the centre of the box of the
            silhouette has the height of the object's centre: the result of localization without any error.
        centres: Centres of the bounding boxes of the labelled objects in the world `(N, 3)` [m].
        ignored: Boxes `(M, 4)` [pixel] of objects that are neither labelled nor background.
        region: Region of the camera image that `image` shows.
        matrix: Camera matrix of the camera image; for an initial scene, that of the cell file.
        X_WC: Pose of the camera; for an initial scene, that of the cell file.
        frame: Camera image of an initial scene `(H, W, 3)`; None for a random scene.
        depth: Depth image of an initial scene `(H, W)` [m]; None without a depth sensor.
        second_frame: Camera image of an initial scene `(H, W, 3)` with different noise.
    """

    image: Image
    labels: tuple[str, ...]
    boxes: Array
    visible_fraction: Array
    positions: Array
    centres: Array
    ignored: Array
    region: Region
    matrix: Array
    X_WC: Pose
    frame: Image | None = None
    depth: Array | None = None
    second_frame: Image | None = None


@dataclass(frozen=True, eq=False)
class RenderedRegion:
    """A region of a camera image without noise.

    Attributes:
        image: Image of the region `(H, W, 3)` uint8, RGB.
        bodies: Visible body at each pixel `(H, W)`, -1 for none.
        region: The region of the camera image.
        matrix: Camera matrix of the camera image.
        X_WC: Pose of the camera.
        noise: Noise that determines the minimum contrast of a labelled object.
    """

    image: Image
    bodies: NDArray[np.int32]
    region: Region
    matrix: Array
    X_WC: Pose
    noise: NoiseConfig


class SceneRenderer:
    """Renders samples of one camera of a cell.

    Args:
        config: The cell file.
        camera: Name of the camera.
        randomized: True for random scenes, whose variation exceeds that of runs, for training. False for
            initial scenes of runs, with the arm in a scan pose.
        scene: Changes to initial scenes of runs.
    """

    def __init__(
        self, config: CellConfig, camera: str, *, randomized: bool = True, scene: SceneConfig = DECLARED_SCENE
    ) -> None:
        self._randomized = randomized
        self._scene = scene
        self._declared_camera = config.cameras[camera]
        self._config = make_true_config(config, scene)
        self._camera = self._config.cameras[camera]
        self._world = World(self._config)
        paint_table(self._world, scene)
        self._matrix, _ = compute_calibration(self._camera)

    def render_sample(self, seed: int) -> Sample:
        """Return the sample of a seed: its first random scene without too many half occluded objects.

        Raises:
            InputError: The workspace has no room for the objects.
        """
        attempt = 0
        while True:
            rng = np.random.default_rng([seed, attempt])
            attempt += 1
            try:
                sample = self._render_random(rng) if self._randomized else self._render_initial(rng)
            except InputError:
                # Whether the objects of a random scene fit into the workspace depends on chance.
                if attempt == MAX_ATTEMPTS:
                    raise
                continue
            if sample is not None:
                return sample

    def close(self) -> None:
        """Close the world; the renderer cannot be used afterwards."""
        self._world.close()

    def _render_random(self, rng: np.random.Generator) -> Sample | None:
        """Return the sample of a random scene, or None if too many objects are half occluded."""
        world = self._world
        is_holding = arrangements.move_arm_randomly(world, self._camera, rng)
        matrix, X_WC = self._matrix, get_camera_pose(world, self._camera)
        (colour, texture), light, noise = ((1.0, 1.0, 1.0), WOOD), CELL_LIGHT, self._camera.noise
        if rng.random() >= DECLARED_FRACTION:
            matrix, X_WC = variations.draw_camera(self._camera, matrix, X_WC, rng)
            (colour, texture), light = variations.draw_table_appearance(rng), variations.draw_light(rng)
            noise = variations.draw_noise(noise, rng)
        region = arrangements.draw_region(self._camera, rng)
        table = colour if texture != WOOD else tuple(np.multiply(colour, variations.WOOD_COLOUR).tolist())
        corners = [(x, y) for x in region[::2] for y in region[1::2]]
        footprint = np.array([intersect_plane(matrix, X_WC, corner, 0.0)[:2] for corner in corners])
        shows_table = region == self._camera.table_view
        drawn = arrangements.draw_arrangement(self._config, footprint, shows_table, table, rng)
        if is_holding:
            drawn.append(arrangements.draw_held_object(world.get_tool_pose(), self._config, rng))
        objects = {world.add_object(one.label, one.X_WO, one.colour, one.model): one for one in drawn}
        with _remove_at_end(world, objects):
            world.table_top.paint(colour, texture)
            rendered = render(world, matrix, X_WC, region, light)
        shown = RenderedRegion(rendered.image, rendered.bodies, region, matrix, X_WC, noise)
        sample = self._label(shown, objects)
        if sample is None:
            return None
        return replace(sample, image=_resize(add_noise(rendered.image, noise, rng)))

    def _render_initial(self, rng: np.random.Generator) -> Sample | None:
        """Return the sample of an initial scene of a run, or None if too many objects are half occluded."""
        world, camera = self._world, self._camera
        pose = np.radians(self._config.arm.poses_deg[str(rng.choice(camera.scan_poses))])
        world.set_joint_positions(pose)
        bodies = spawn_objects(world, self._config, int(rng.integers(2**32)), unknown=self._scene.unknown)
        world.set_joint_positions(pose)  # the arm may have sagged during the physics steps
        with _remove_at_end(world, bodies):
            X_WC = get_camera_pose(world, camera)
            declared_X_WC = get_camera_pose(world, self._declared_camera)
            objects = {
                body: SceneObject(world.labels[body], world.models[body], world.get_object_pose(body), BLACK)
                for body in bodies
            }
            whole_image, light = (0, 0, camera.width, camera.height), build_light(self._scene.light)
            rendered = render(world, self._matrix, X_WC, whole_image, light)
        frame = add_noise(rendered.image, camera.noise, rng)
        depth = None if camera.depth is None else add_depth_noise(rendered.depth, camera.depth, rng)
        second_frame = add_noise(rendered.image, camera.noise, rng)
        left, top, right, bottom = region = camera.table_view
        image, visible = rendered.image[top:bottom, left:right], rendered.bodies[top:bottom, left:right]
        # The minimum contrast follows from the declared noise, so that more noise does not reduce the labels.
        noise = self._declared_camera.noise
        shown = RenderedRegion(image, visible, region, self._matrix, X_WC, noise)
        sample = self._label(shown, objects)
        if sample is None:
            return None
        # A run uses the declared matrix and pose, even if the scene has errors of the camera.
        sample = replace(sample, matrix=compute_calibration(self._declared_camera)[0], X_WC=declared_X_WC)
        image = _resize(frame[top:bottom, left:right])
        return replace(sample, image=image, frame=frame, depth=depth, second_frame=second_frame)

    def _label(self, shown: RenderedRegion, objects: Mapping[int, SceneObject]) -> Sample | None:
        """Return the labelled region, or None if too many of the objects, by body, are half occluded."""
        labelled: list[tuple[str, list[float], float, Array, Array]] = []
        ignored, half_occluded_count = [], 0
        corner = np.array(shown.region[:2], dtype=float)
        scale = IMAGE_SIZE / (shown.region[2] - shown.region[0])
        for body, scene_object in objects.items():
            mask = shown.bodies == body
            if scene_object.label == UNKNOWN_LABEL or not mask.any():
                continue
            mesh = load_mesh(scene_object.model)
            vertices = scene_object.X_WO.apply(mesh.vertices)
            pixels = project(shown.matrix, shown.X_WC, vertices)
            fraction = compute_visible_fraction(mesh, pixels, mask)
            whole_box = compute_bounding_box(pixels)
            box = _transform_box(whole_box, corner, scale)
            if fraction < MIN_VISIBLE_FRACTION:
                continue
            is_half_occluded = fraction < MIN_LABELLED_FRACTION
            half_occluded_count += is_half_occluded
            if is_half_occluded or measure_contrast(shown.image, mask) < MIN_CONTRAST * shown.noise.read:
                ignored.append(box)
                continue
            centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
            pixel = ((whole_box[0] + whole_box[2]) / 2, (whole_box[1] + whole_box[3]) / 2)
            position = intersect_plane(shown.matrix, shown.X_WC, pixel, float(centre[2]))
            labelled.append((scene_object.label, box, fraction, position, centre))
        if half_occluded_count > max(1, len(objects) * MAX_HALF_OCCLUDED_FRACTION):
            return None
        return Sample(
            image=shown.image,
            labels=tuple(label for label, *_ in labelled),
            boxes=np.array([box for _, box, *_ in labelled]).reshape(-1, 4),
            visible_fraction=np.array([fraction for *_, fraction, _, _ in labelled]),
            positions=np.array([position for *_, position, _ in labelled]).reshape(-1, 3),
            centres=np.array([centre for *_, centre in labelled]).reshape(-1, 3),
            ignored=np.array(ignored).reshape(-1, 4),
            region=shown.region,
            matrix=shown.matrix,
            X_WC=shown.X_WC,
        )


@contextmanager
def _remove_at_end(world: World, bodies: Iterable[int]) -> Iterator[None]:
    """Remove bodies from the world at the end of the context."""
    try:
        yield
    finally:
        for body in bodies:
            world.remove_object(body)


def measure_contrast(image: Image, mask: NDArray[np.bool_]) -> float:
    """Return the contrast between an object and a ring of two pixels around the object [grey level].

    The contrast of a pixel is its maximum difference over the three colours from the median of the ring. The
    result is the median of the contrasts of the object's pixels, or 0 if the ring is empty.

    Args:
        image: Image `(H, W, 3)`.
        mask: Mask of the pixels that show the object `(H, W)`.
    """
    ring = cv2.dilate(mask.astype(np.uint8), np.ones((5, 5), np.uint8)).astype(bool) & ~mask
    if not ring.any():
        return 0.0
    background = np.median(image[ring], axis=0)
    return float(np.median(np.abs(image[mask] - background).max(axis=1)))


def _transform_box(box: Box, corner: Array, scale: float) -> list[float]:
    """Return a box of the camera image as a box in the image of a sample, clipped at the borders."""
    points = (np.array(box).reshape(2, 2) - corner) * scale
    return [float(value) for value in points.clip(0, IMAGE_SIZE).ravel()]


def _resize(image: Image) -> Image:
    if image.shape[0] == IMAGE_SIZE:
        return image
    return np.asarray(
        cv2.resize(image, (IMAGE_SIZE, IMAGE_SIZE), interpolation=cv2.INTER_AREA), dtype=np.uint8
    )
