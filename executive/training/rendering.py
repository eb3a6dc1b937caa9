"""Rendering of labelled images of random scenes, for the training and the evaluation of detectors.

An image depends only on its seed and on the arguments of `SceneRenderer`, not on the number of processes that
render images. Labels are amodal with subpixel accuracy: the box of an object contains the whole silhouette of
the mesh, including occluded parts.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell.config import CellConfig
from executive.cell.devices import TrueObject
from executive.cell.frame import Box
from executive.cell.objects import UNKNOWN_LABEL
from executive.drivers.sim import arrangements, models
from executive.drivers.sim.camera import (
    CELL_LIGHT,
    Image,
    RenderedImage,
    add_depth_noise,
    add_noise,
    get_camera_pose,
    render,
)
from executive.drivers.sim.model_check import find_model_errors
from executive.drivers.sim.scene import DECLARED_SCENE, SceneConfig, build_world
from executive.drivers.sim.spawn import spawn_objects
from executive.drivers.sim.world import WOOD_TEXTURE
from executive.errors import InputError
from executive.motion.joints import build_kinematics
from executive.perception.camera_model import compute_calibration, intersect_plane, project
from executive.physics.arm_model import find_arm_model_errors
from executive.processes import WorkerPool
from executive.training import dataset
from executive.training.dataset import DatasetEntry, LabelledImage

ResultT = TypeVar("ResultT")
ReportProgress = Callable[[int, int], None]
"""Callback with the number of finished images and the number of all images."""
BLOCK_SIZE = 40
"""Number of images per task of a worker process; each task builds a simulated world for each cell."""
IMAGE_SIZE = 256
"""Side of the image of a random scene, as a detector gets it [pixel]."""
MIN_VISIBLE_FRACTION = 0.15
"""An object of which a smaller fraction is visible is treated as background."""
MIN_LABELLED_VISIBLE_FRACTION = 0.5
"""An object of which a smaller fraction is visible is heavily occluded: it is ignored, not labelled."""
MAX_HEAVILY_OCCLUDED_FRACTION = 1 / 6
"""Maximum fraction of heavily occluded objects in a scene; one such object is always allowed."""
MAX_ATTEMPTS = 50
"""Maximum number of random scenes that are sampled for an image before an error is raised."""
NOMINAL_SCENE_FRACTION = 0.35
"""Fraction of the random scenes with table, light, camera and noise as in the cell file."""
MIN_CONTRAST = 5
"""Minimum contrast between a labelled object and its surroundings, in standard deviations of the noise."""


def generate_dataset(
    cells: Sequence[CellConfig], out: Path, *, image_count: int, seed: int, layout: str,
    worker_count: int, valid_fraction: float, progress: ReportProgress,
) -> None:  # fmt: skip
    """Write a dataset of random scenes, in turn of each cell, with the classes of all cells.

    Args:
        cells: The cells.
        out: Folder of the dataset.
        image_count: Number of images.
        seed: Seed of the random scenes.
        layout: `coco` or `yolo`.
        worker_count: Number of rendering processes.
        valid_fraction: Fraction of the images in the split `valid`, 0 to 1; these are the last images.
        progress: Called after each block of `BLOCK_SIZE` images.

    Raises:
        InputError: A model of an object or arm is missing or invalid, an object has another size than in the
            cell file, or a file cannot be written.
    """
    for cell in cells:
        for key, message in (*find_model_errors(cell), *find_arm_model_errors(cell.arm)):
            raise InputError(f"{cell.cell}: {'.'.join(map(str, key))}: {message}")
    train_count = image_count - round(image_count * valid_fraction)
    render_block = partial(_render_dataset_images, cells, out, layout, seed, train_count)
    entries = _render_blocks(render_block, image_count, worker_count, progress)
    classes = list(dict.fromkeys(label for cell in cells for label in cell.objects))
    dataset.write_annotations(out, layout, entries, classes)


def render_run_frames(
    config: CellConfig, *, image_count: int, seed: int, worker_count: int, progress: ReportProgress,
    scene: SceneConfig = DECLARED_SCENE,
) -> list[LabelledImage]:  # fmt: skip
    """Return full frames of a cell's camera, each of a random scene like those of runs.

    The objects in the camera's view `table` are labelled.

    Args:
        config: The cell.
        image_count: Number of frames.
        seed: Seed of the random scenes.
        worker_count: Number of rendering processes.
        progress: Called after each block of `BLOCK_SIZE` frames.
        scene: Differences of the simulated world from the cell file.
    """
    render_block = partial(_render_images, [config], scene, seed)
    return _render_blocks(render_block, image_count, worker_count, progress)


def _render_blocks(
    render_block: Callable[[range], list[ResultT]], count: int, workers: int, progress: ReportProgress
) -> list[ResultT]:
    """Return the results of `render_block` for images 0 to `count` - 1, in order, from worker processes."""
    numbers = range(count)
    results: list[ResultT] = []
    with WorkerPool(workers) as pool:
        for block in pool.map(render_block, [numbers[i : i + BLOCK_SIZE] for i in numbers[::BLOCK_SIZE]]):
            results += block
            progress(len(results), count)
    return results


def _render_images(
    cells: Sequence[CellConfig], scene: SceneConfig | None, seed: int, image_numbers: range
) -> list[LabelledImage]:
    """Return labelled images of random scenes; without `scene`, the scenes vary more."""
    cv2.setNumThreads(1)
    images = []
    with contextlib.ExitStack() as stack:
        renderers = [stack.enter_context(contextlib.closing(SceneRenderer(cell, scene))) for cell in cells]
        for number in image_numbers:
            image_seed = int(np.random.SeedSequence([seed, number]).generate_state(1, np.uint64)[0])
            images.append(renderers[number % len(cells)].render_image(image_seed, number))
    return images


def _render_dataset_images(
    cells: Sequence[CellConfig], out: Path, layout: str, seed: int, train_count: int, image_numbers: range
) -> list[DatasetEntry]:
    """Render and save images in a worker process; return their dataset entries."""
    entries = []
    for number, image in zip(image_numbers, _render_images(cells, None, seed, image_numbers), strict=True):
        split = "train" if number < train_count else "valid"
        file = f"{image.file}.jpg"
        dataset.save_image(dataset.build_image_path(out, layout, split, file), image.image)
        # The ground truth for evaluations is stored as JSON.
        truth = {**image.truth, "matrix": image.truth["matrix"].tolist()}
        for name, digits in (("positions", 6), ("centres", 6), ("visible_fraction", 4)):
            truth[name] = truth[name].round(digits).tolist()
        size = (IMAGE_SIZE, IMAGE_SIZE)
        entry = DatasetEntry(split, file, size, image.labels, image.boxes, image.ignored_boxes, truth)
        entries.append(entry)
    return entries


class SceneRenderer:
    """Renders labelled images of the camera of a cell.

    Without `scene`, an image shows a part of a random scene. Random scenes serve for training; they vary more
    than the initial scenes of runs. With `scene`, an image is a complete camera image of the initial scene of
    a run; only the objects in the view `table` (the workspace) are labelled.

    Args:
        config: The cell file.
        scene: Scene file for the initial scene of a run, in which the arm is in a random scan pose; None for
            random scenes.
    """

    def __init__(self, config: CellConfig, scene: SceneConfig | None = None) -> None:
        self._scene = scene
        self._camera_name, self._nominal_camera = next(iter(config.cameras.items()))
        self._world = build_world(config, scene or DECLARED_SCENE)
        self._config = self._world.config
        self._kinematics = build_kinematics(self._config)
        self._camera = self._config.cameras[self._camera_name]
        self._camera_matrix, _ = compute_calibration(self._camera)

    def render_image(self, seed: int, number: int) -> LabelledImage:
        """Sample scenes from `seed` until few objects are heavily occluded, and return the labelled image.

        Its file name contains the name of the camera and `number`, and has no suffix. Its `truth` contains:

        * `camera`, `matrix`, `X_WC`: name, matrix and pose of the camera; for an initial scene, matrix and
          pose as declared in the cell file, without calibration errors
        * `part`: the region of the camera image that the image shows [pixel]
        * `labels`, `visible_fraction`: class and visible fraction (0 to 1) of each labelled object
        * `centres`: centres of the bounding boxes of the labelled objects in the world `(N, 3)` [m]
        * `positions`: result of a localization without errors `(N, 3)` [m]: intersection of the ray through
          the centre of each unclipped box with the horizontal plane through the object centre

        Raises:
            InputError: In all `MAX_ATTEMPTS` scenes, the workspace has no room for the objects, or too many
                objects are heavily occluded.
        """
        problem = InputError(
            f"too many objects are heavily occluded in {MAX_ATTEMPTS} scenes of cell {self._config.cell}; "
            "ask for fewer objects or widen table.x and table.y"
        )
        for attempt in range(MAX_ATTEMPTS):
            rng = np.random.default_rng([seed, attempt])
            for body in tuple(self._world.labels):
                self._world.remove_object(body)
            try:
                image = self._render_initial(self._scene, rng) if self._scene else self._render_random(rng)
                if image is not None:
                    return replace(image, file=f"{self._camera_name}_{number:06d}")
            except InputError as error:
                # Whether the objects of a random scene find room in the workspace depends on chance.
                problem = error
        raise problem

    def close(self) -> None:
        """Close the world; the renderer cannot be used afterwards."""
        self._world.close()

    def _render_random(self, rng: np.random.Generator) -> LabelledImage | None:
        """Return the image of a random scene, or None if too many objects are heavily occluded."""
        world = self._world
        is_holding = arrangements.move_arm_randomly(world, self._kinematics, self._camera, rng)
        matrix = self._camera_matrix
        X_WC = get_camera_pose(world, self._camera)
        colour = (1.0, 1.0, 1.0)
        texture = WOOD_TEXTURE
        light = CELL_LIGHT
        noise = self._camera.noise
        if rng.random() >= NOMINAL_SCENE_FRACTION:
            matrix, X_WC = arrangements.draw_camera(self._camera, matrix, X_WC, rng)
            colour, texture = arrangements.draw_table_appearance(rng)
            light = arrangements.draw_light(rng)
            noise = arrangements.draw_noise(noise, rng)
        region = arrangements.draw_region(self._camera, rng)
        wood_colour = tuple(np.multiply(colour, arrangements.WOOD_COLOUR).tolist())
        table_colour = wood_colour if texture == WOOD_TEXTURE else colour
        corners = [(x, y) for x in region[::2] for y in region[1::2]]
        footprint = np.array([intersect_plane(matrix, X_WC, corner, 0.0)[:2] for corner in corners])
        shows_table = region == self._camera.table_view
        objects = arrangements.draw_arrangement(self._config, footprint, shows_table, table_colour, rng)
        if is_holding:
            objects.append(arrangements.draw_held_object(world.get_tool_pose(), self._config, rng))
        objects_by_body = {world.add_object(o.label, o.X_WO, o.colour, o.model): o for o in objects}
        world.paint_table(colour, texture)
        rendered = render(world, matrix, X_WC, region, light)
        scale = IMAGE_SIZE / (region[2] - region[0])
        labelled = self._label_image(rendered, MIN_CONTRAST * noise.read, objects_by_body, region[:2], scale)
        image = add_noise(rendered.image, noise, rng)
        resized_image = cv2.resize(image, (IMAGE_SIZE, IMAGE_SIZE), interpolation=cv2.INTER_AREA)
        return labelled and replace(labelled, image=np.asarray(resized_image, np.uint8))

    def _render_initial(self, scene: SceneConfig, rng: np.random.Generator) -> LabelledImage | None:
        """Return the image of an initial scene, or None if too many objects are heavily occluded."""
        world = self._world
        camera = self._camera
        pose = np.radians(self._config.arm.poses_deg[str(rng.choice(camera.scan_poses))])
        world.set_joint_positions(pose)
        spawn_objects(world, int(rng.integers(2**32)), scene.unknown)
        world.set_joint_positions(pose)  # the arm may have sagged during the physics steps
        X_WC = get_camera_pose(world, camera)
        # A run uses the declared matrix and pose, even if the scene has calibration errors.
        whole_image = (0, 0, camera.width, camera.height)
        declared_X_WC = get_camera_pose(world, self._nominal_camera).to_rounded_list(9)
        declared_matrix, _ = compute_calibration(self._nominal_camera)
        declared_calibration = {"part": whole_image, "matrix": declared_matrix, "X_WC": declared_X_WC}
        objects = {body: world.describe_object(body) for body in world.labels}
        rendered = render(world, self._camera_matrix, X_WC, whole_image, scene.light)
        image = add_noise(rendered.image, camera.noise, rng)
        depth = None if camera.depth is None else add_depth_noise(rendered.depth, camera.depth, rng)
        repeated_image = add_noise(rendered.image, camera.noise, rng)
        left, top, right, bottom = region = camera.table_view
        pixels = np.s_[top:bottom, left:right]
        view = replace(
            rendered, image=rendered.image[pixels], segmentation=rendered.segmentation[pixels], region=region
        )
        # The minimum contrast depends on the declared noise, so that more noise does not reduce the labels.
        labelled = self._label_image(view, MIN_CONTRAST * self._nominal_camera.noise.read, objects)
        return labelled and replace(
            labelled, image=image, truth={**labelled.truth, **declared_calibration}, region=region,
            depth=depth, repeated_image=repeated_image,
        )  # fmt: skip

    def _label_image(
        self,
        rendered: RenderedImage,
        min_contrast: float,
        objects: Mapping[int, TrueObject],
        origin: Sequence[int] = (0, 0),
        scale: float = 1.0,
    ) -> LabelledImage | None:
        """Return a labelled image without noise, or None if too many objects are heavily occluded.

        Args:
            rendered: The rendered image.
            min_contrast: Contrast below which objects are ignored [grey level].
            objects: The objects by body.
            origin: Position in the camera image at which the boxes have the coordinates (0, 0) [pixel].
            scale: Factor from pixels of the camera image to pixels of the boxes.
        """
        labelled_objects = []
        ignored_boxes: list[Box] = []
        heavily_occluded_count = 0
        for body, scene_object in objects.items():
            mask = rendered.segmentation == body
            if scene_object.label == UNKNOWN_LABEL or not mask.any():
                continue
            mesh = models.load_mesh(arrangements.get_model(scene_object))
            vertices = scene_object.X_WO.apply(mesh.vertices)
            pixels = project(rendered.matrix, rendered.X_WC, vertices)
            fraction = min(1.0, float(mask.sum()) / max(models.compute_silhouette_area(mesh, pixels), 1.0))
            if fraction < MIN_VISIBLE_FRACTION:
                continue
            corners = np.array(models.compute_bounding_box(pixels)).reshape(2, 2)
            visible_corners = corners.clip(rendered.region[:2], rendered.region[2:])
            left, top, right, bottom = ((visible_corners - origin) * scale).ravel().tolist()
            box = (left, top, right, bottom)
            is_heavily_occluded = fraction < MIN_LABELLED_VISIBLE_FRACTION
            heavily_occluded_count += is_heavily_occluded
            if is_heavily_occluded or _measure_contrast(rendered.image, mask) < min_contrast:
                ignored_boxes.append(box)
                continue
            centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
            pixel = corners.mean(axis=0)
            position = intersect_plane(rendered.matrix, rendered.X_WC, pixel, float(centre[2]))
            labelled_objects.append((scene_object.label, box, fraction, position, centre))
        if heavily_occluded_count > max(1, len(objects) * MAX_HEAVILY_OCCLUDED_FRACTION):
            return None
        columns = zip(*labelled_objects, strict=True) if labelled_objects else [()] * 5
        labels, boxes, fractions, positions, centres = columns
        truth = {
            "camera": self._camera_name,
            "part": rendered.region,
            "matrix": rendered.matrix,
            "X_WC": rendered.X_WC.to_rounded_list(9),
            "labels": labels,
            "positions": np.array(positions).reshape(-1, 3),
            "centres": np.array(centres).reshape(-1, 3),
            "visible_fraction": np.array(fractions),
        }
        return LabelledImage("", rendered.image, labels, boxes, tuple(ignored_boxes), truth)


def _measure_contrast(image: Image, mask: NDArray[np.bool_]) -> float:
    """Return the contrast between an object and a ring of two pixels around the object [grey level].

    The contrast of a pixel is the maximum, over the three channels, of the difference from the median of
    the ring.
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
