"""Random labelled scenes of a cell, for the training and the evaluation of detectors.

A sample depends only on its seed and on the arguments of `SceneRenderer`. Labels are amodal with subpixel
accuracy: the box of an object contains the whole silhouette of the mesh, including occluded parts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell.config import CellConfig
from executive.cells.ground_truth import UNKNOWN_LABEL
from executive.cells.sim import arrangements, variations
from executive.cells.sim.arrangements import SceneObject
from executive.cells.sim.camera import add_depth_noise, add_noise, get_camera_pose
from executive.cells.sim.models import load_mesh
from executive.cells.sim.renderer import CELL_LIGHT, Image, Region, RenderedImage, render
from executive.cells.sim.scene_file import DECLARED_SCENE, SceneConfig
from executive.cells.sim.scene_world import apply_scene, paint_table
from executive.cells.sim.silhouette import compute_bounding_box, compute_silhouette_area
from executive.cells.sim.spawn import spawn_objects
from executive.cells.sim.table_top import WOOD_TEXTURE
from executive.cells.sim.world import World
from executive.errors import InputError
from executive.geometry import Array, Pose
from executive.perception.camera_model import compute_calibration, intersect_plane, project

IMAGE_SIZE = 256
"""Side of the image of a sample, as a detector gets it [pixel]."""
MIN_VISIBLE_FRACTION, MIN_LABELLED_VISIBLE_FRACTION = 0.15, 0.5
"""Visible fractions below which an object is background, or is ignored instead of labelled."""
MAX_HEAVILY_OCCLUDED_FRACTION = 1 / 6
"""Maximum fraction of heavily occluded objects in a scene; one such object is always allowed."""
MAX_ATTEMPTS = 50
"""Number of random scenes for a sample after which a lack of room for the objects is an error."""
UNVARIED_SCENE_FRACTION = 0.2
"""Fraction of the random scenes with table, light, camera and noise as in the cell file."""
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
        positions: Positions `(N, 3)` [m] from a localization without errors: the points at which the rays
            through the centres of the unclipped boxes reach the heights of the object centres.
        centres: Centres of the bounding boxes of the labelled objects in the world `(N, 3)` [m].
        ignored: Boxes `(M, 4)` [pixel] of objects that are neither labelled nor background.
        region: Region of the camera image that `image` shows.
        matrix: Camera matrix `(3, 3)` [pixel]; for an initial scene, the matrix of the cell file.
        X_WC: Pose of the camera in the world; for an initial scene, the pose of the cell file.
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


class SceneRenderer:
    """Renders samples of one camera of a cell.

    Args:
        config: The cell file.
        camera: Name of the camera.
        scene: Changes to initial scenes of runs, with the arm in a scan pose; None for random scenes, which
            vary more than runs, for training.
    """

    def __init__(self, config: CellConfig, camera: str, scene: SceneConfig | None = None) -> None:
        self._scene = scene
        self._declared_camera = config.cameras[camera]
        self._config = apply_scene(config, scene or DECLARED_SCENE)
        self._camera = self._config.cameras[camera]
        self._world = World(self._config)
        paint_table(self._world, scene or DECLARED_SCENE)
        self._matrix, _ = compute_calibration(self._camera)

    def render_sample(self, seed: int) -> Sample:
        """Return the first sample generated from a seed in which few objects are heavily occluded.

        Raises:
            InputError: The workspace has no room for the objects.
        """
        attempt = 0
        while True:
            rng = np.random.default_rng([seed, attempt])
            attempt += 1
            for body in tuple(self._world.labels):
                self._world.remove_object(body)
            try:
                sample = self._render_initial(self._scene, rng) if self._scene else self._render_random(rng)
                if sample is not None:
                    return sample
            except InputError:
                # Whether the objects of a random scene find room in the workspace depends on chance.
                if attempt == MAX_ATTEMPTS:
                    raise

    def close(self) -> None:
        """Close the world; the renderer cannot be used afterwards."""
        self._world.close()

    def _render_random(self, rng: np.random.Generator) -> Sample | None:
        """Return the sample of a random scene, or None if too many objects are heavily occluded."""
        world = self._world
        is_holding = arrangements.move_arm_randomly(world, self._camera, rng)
        matrix, X_WC = self._matrix, get_camera_pose(world, self._camera)
        (colour, texture), light, noise = ((1.0, 1.0, 1.0), WOOD_TEXTURE), CELL_LIGHT, self._camera.noise
        if rng.random() >= UNVARIED_SCENE_FRACTION:
            matrix, X_WC = variations.draw_camera(self._camera, matrix, X_WC, rng)
            (colour, texture), light = variations.draw_table_appearance(rng), variations.draw_light(rng)
            noise = variations.draw_noise(noise, rng)
        region = arrangements.draw_region(self._camera, rng)
        wood_colour = tuple(np.multiply(colour, variations.WOOD_COLOUR).tolist())
        table_colour = wood_colour if texture == WOOD_TEXTURE else colour
        corners = [(x, y) for x in region[::2] for y in region[1::2]]
        footprint = np.array([intersect_plane(matrix, X_WC, corner, 0.0)[:2] for corner in corners])
        shows_table = region == self._camera.table_view
        objects = arrangements.draw_arrangement(self._config, footprint, shows_table, table_colour, rng)
        if is_holding:
            objects.append(arrangements.draw_held_object(world.get_tool_pose(), self._config, rng))
        objects_by_body = {world.add_object(o.label, o.X_WO, o.colour, o.model): o for o in objects}
        world.table_top.paint(colour, texture)
        rendered = render(world, matrix, X_WC, region, light)
        sample = _build_sample(rendered, MIN_CONTRAST * noise.read, objects_by_body)
        return sample and replace(sample, image=_resize(add_noise(rendered.image, noise, rng)))

    def _render_initial(self, scene: SceneConfig, rng: np.random.Generator) -> Sample | None:
        """Return the sample of an initial scene, or None if too many objects are heavily occluded."""
        world, camera = self._world, self._camera
        pose = np.radians(self._config.arm.poses_deg[str(rng.choice(camera.scan_poses))])
        world.set_joint_positions(pose)
        spawn_objects(world, int(rng.integers(2**32)), scene.unknown)
        world.set_joint_positions(pose)  # the arm may have sagged during the physics steps
        X_WC = get_camera_pose(world, camera)
        declared_X_WC = get_camera_pose(world, self._declared_camera)
        objects = {
            body: SceneObject(label, world.models[body], world.get_object_pose(body))
            for body, label in world.labels.items()
        }
        whole_image = (0, 0, camera.width, camera.height)
        rendered = render(world, self._matrix, X_WC, whole_image, scene.light)
        frame = add_noise(rendered.image, camera.noise, rng)
        depth = None if camera.depth is None else add_depth_noise(rendered.depth, camera.depth, rng)
        second_frame = add_noise(rendered.image, camera.noise, rng)
        left, top, right, bottom = region = camera.table_view
        pixels = np.s_[top:bottom, left:right]
        image, segmentation = rendered.image[pixels], rendered.segmentation[pixels]
        view = replace(rendered, image=image, segmentation=segmentation, region=region)
        # The minimum contrast depends on the declared noise, so that more noise does not reduce the labels.
        sample = _build_sample(view, MIN_CONTRAST * self._declared_camera.noise.read, objects)
        # A run uses the declared matrix and pose, even if the scene has calibration errors.
        return sample and replace(
            sample,
            image=_resize(frame[pixels]),
            matrix=compute_calibration(self._declared_camera)[0],
            X_WC=declared_X_WC,
            frame=frame,
            depth=depth,
            second_frame=second_frame,
        )


def _build_sample(
    rendered: RenderedImage, min_contrast: float, objects: Mapping[int, SceneObject]
) -> Sample | None:
    """Return a sample without noise, or None if too many objects are heavily occluded.

    `objects` is indexed by body. Objects with less contrast than `min_contrast` [grey level] are ignored.
    """
    labels, boxes, fractions, positions, centres = [], [], [], [], []
    ignored, heavily_occluded_count = [], 0
    corner = np.array(rendered.region[:2], dtype=float)
    scale = IMAGE_SIZE / (rendered.region[2] - rendered.region[0])
    for body, scene_object in objects.items():
        mask = rendered.segmentation == body
        if scene_object.label == UNKNOWN_LABEL or not mask.any():
            continue
        mesh = load_mesh(scene_object.model)
        vertices = scene_object.X_WO.apply(mesh.vertices)
        pixels = project(rendered.matrix, rendered.X_WC, vertices)
        fraction = min(1.0, float(mask.sum()) / max(compute_silhouette_area(mesh, pixels), 1.0))
        if fraction < MIN_VISIBLE_FRACTION:
            continue
        unclipped_box = np.array(compute_bounding_box(pixels)).reshape(2, 2)
        box = ((unclipped_box - corner) * scale).clip(0, IMAGE_SIZE).ravel()
        is_heavily_occluded = fraction < MIN_LABELLED_VISIBLE_FRACTION
        heavily_occluded_count += is_heavily_occluded
        if is_heavily_occluded or _measure_contrast(rendered.image, mask) < min_contrast:
            ignored.append(box)
            continue
        centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        pixel = (unclipped_box[0] + unclipped_box[1]) / 2
        labels.append(scene_object.label)
        boxes.append(box)
        fractions.append(fraction)
        positions.append(intersect_plane(rendered.matrix, rendered.X_WC, pixel, float(centre[2])))
        centres.append(centre)
    if heavily_occluded_count > max(1, len(objects) * MAX_HEAVILY_OCCLUDED_FRACTION):
        return None
    return Sample(
        image=rendered.image,
        labels=tuple(labels),
        boxes=np.array(boxes).reshape(-1, 4),
        visible_fraction=np.array(fractions),
        positions=np.array(positions).reshape(-1, 3),
        centres=np.array(centres).reshape(-1, 3),
        ignored=np.array(ignored).reshape(-1, 4),
        region=rendered.region,
        matrix=rendered.matrix,
        X_WC=rendered.X_WC,
    )


def _measure_contrast(image: Image, mask: NDArray[np.bool_]) -> float:
    """Return the contrast between an object and a ring of two pixels around the object [grey level].

    The contrast of a pixel is the maximum difference from the median of the ring over the three channels.
    The result is the median contrast of the object's pixels, or 0 if the ring is empty.

    Args:
        image: Image `(H, W, 3)`.
        mask: Mask of the pixels that show the object `(H, W)`.
    """
    ring = cv2.dilate(mask.astype(np.uint8), np.ones((5, 5), np.uint8)).astype(bool) & ~mask
    if not ring.any():
        return 0.0
    background = np.median(image[ring], axis=0)
    return float(np.median(np.abs(image[mask] - background).max(axis=1)))


def _resize(image: Image) -> Image:
    """Return a square image in the size of a sample."""
    return np.asarray(cv2.resize(image, (IMAGE_SIZE, IMAGE_SIZE), interpolation=cv2.INTER_AREA), np.uint8)
