"""Random labelled scenes of a cell, for training and measuring detectors.

A sample is a function of cell file, camera and seed alone. Labels are amodal and sub-pixel: the box
of an object's whole silhouette, computed from its mesh, also where something hides a part of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell_config import CellConfig
from executive.geometry import Array, Pose
from executive.messages import Box
from executive.sim.arrangements import Item, arrange, hanging, random_light, random_part, random_tint, reach
from executive.sim.camera import CELL_LIGHT, Image, add_noise, camera_pose, render, sense
from executive.sim.models import load_mesh
from executive.sim.silhouette import outline_box, visible_share
from executive.sim.spawn import spawn
from executive.sim.world import World
from executive.vision.camera_model import calibrated, on_plane, project

SIZE = 256
"""Side of a sample's image [pixel]: what a detector is given."""
LABELLED = 0.5
"""Share of its silhouette that must be visible for an object to be labelled."""
UNNOTICED = 0.15
"""Share under which an object counts as hidden; in between it is neither labelled nor background."""
MOST_IGNORED = 1
"""Objects between the two that a scene may have: more would confuse training."""


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
        matrix: Camera matrix of the whole image.
        X_WC: Where the camera was.
        frame: The camera's whole image `(H, W, 3)`, of a scene as a run begins with.
        depth: What its depth sensor gives `(H, W)` [m], likewise; None without one.
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


class SceneRenderer:
    """Makes samples of one camera of a cell, reusing one world for all of them.

    With `randomized`, everything varies more than a run can: for training. Without, scenes are as a run
    begins with: objects set down by `spawn`, the cell's own lamp, the arm at one of the scan poses.
    """

    def __init__(self, config: CellConfig, camera: str, *, randomized: bool = True) -> None:
        self._config = config
        self._randomized = randomized
        self._camera = config.cameras[camera]
        self._meshes = {label: load_mesh(model) for label, model in config.objects.items()}
        self._world = World(config)
        self._matrix, _ = calibrated(self._camera)

    def sample(self, seed: int) -> Sample:
        """Return the sample of `seed`: the first of its random scenes with few half-hidden objects."""
        attempt = 0
        while True:
            rng = np.random.default_rng([seed, attempt])
            sample = self._draw(rng) if self._randomized else self._draw_as_run(rng)
            if sample is not None:
                return sample
            attempt += 1

    def close(self) -> None:
        """Give the world back."""
        self._world.close()

    def _draw(self, rng: np.random.Generator) -> Sample | None:
        world = self._world
        holds = reach(world, self._camera, rng)
        X_WC = camera_pose(world, self._camera)
        part = random_part(self._camera, rng)
        corners = [(x, y) for x in part[::2] for y in part[1::2]]
        footprint = np.array([on_plane(self._matrix, X_WC, corner, 0.0)[:2] for corner in corners])
        plain_view = part == self._camera.table_view
        items = arrange(self._config, self._meshes, footprint, plain_view, rng)
        if holds:
            items.append(hanging(world.tool_pose(), self._meshes, self._config, rng))
        bodies = [world.add_object(*item) for item in items]
        try:
            world.client.changeVisualShape(world.table, -1, rgbaColor=[*random_tint(rng), 1])
            shot = render(world, self._matrix, X_WC, part, random_light(rng))
        finally:
            for body in bodies:
                world.remove_object(body)
        image = add_noise(shot.image, self._camera.noise, rng)
        return self._label(image, shot.bodies, bodies, items, X_WC, part)

    def _draw_as_run(self, rng: np.random.Generator) -> Sample | None:
        world, camera = self._world, self._camera
        pose = np.radians(self._config.arm.poses_deg[str(rng.choice(camera.scan_poses))])
        world.set_arm(pose)
        bodies = spawn(world, self._config, int(rng.integers(2**32)))
        world.set_arm(pose)  # settling may have let it sag
        try:
            X_WC = camera_pose(world, camera)
            items = [(world.bodies[body], world.object_pose(body), (0.0, 0.0, 0.0)) for body in bodies]
            shot = render(world, self._matrix, X_WC, (0, 0, camera.width, camera.height), CELL_LIGHT)
        finally:
            for body in bodies:
                world.remove_object(body)
        frame = add_noise(shot.image, camera.noise, rng)
        depth = None if camera.depth is None else sense(shot.depth, camera.depth, rng)
        left, top, right, bottom = part = camera.table_view
        image, seen = frame[top:bottom, left:right], shot.bodies[top:bottom, left:right]
        sample = self._label(image, seen, bodies, items, X_WC, part)
        return None if sample is None else replace(sample, frame=frame, depth=depth)

    def _label(
        self,
        image: Image,
        seen: NDArray[np.int32],
        bodies: Sequence[int],
        items: Sequence[Item],
        X_WC: Pose,
        part: tuple[int, int, int, int],
    ) -> Sample | None:
        """Label a render, or return None where too many objects are half hidden."""
        labels, boxes, shares, positions, centres, ignored = [], [], [], [], [], []
        corner, scale = np.array(part[:2], dtype=float), SIZE / (part[2] - part[0])
        for body, (label, X_WO, _) in zip(bodies, items, strict=True):
            mine = seen == body
            if not mine.any():
                continue
            mesh = self._meshes[label]
            vertices = X_WO.apply(mesh.vertices)
            pixels = project(self._matrix, X_WC, vertices)
            share = visible_share(mesh, pixels, mine)
            whole = outline_box(pixels)
            box = _clipped(whole, corner, scale)
            if share < UNNOTICED:
                continue
            if share < LABELLED:
                ignored.append(box)
                continue
            centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
            middle = ((whole[0] + whole[2]) / 2, (whole[1] + whole[3]) / 2)
            labels.append(label)
            boxes.append(box)
            shares.append(share)
            positions.append(on_plane(self._matrix, X_WC, middle, float(centre[2])))
            centres.append(centre)
        if len(ignored) > MOST_IGNORED:
            return None
        return Sample(
            image=_resized(image),
            labels=tuple(labels),
            boxes=np.array(boxes).reshape(-1, 4),
            visible_fraction=np.array(shares),
            positions=np.array(positions).reshape(-1, 3),
            centres=np.array(centres).reshape(-1, 3),
            ignored=np.array(ignored).reshape(-1, 4),
            part=part,
            matrix=self._matrix,
            X_WC=X_WC,
        )


def _clipped(box: Box, corner: Array, scale: float) -> list[float]:
    """Return a box of the whole image in a sample's pixels, cut at its edges."""
    points = (np.array(box).reshape(2, 2) - corner) * scale
    return [float(value) for value in points.clip(0, SIZE).ravel()]


def _resized(image: Image) -> Image:
    if image.shape[0] == SIZE:
        return image
    return np.asarray(cv2.resize(image, (SIZE, SIZE), interpolation=cv2.INTER_AREA), dtype=np.uint8)
