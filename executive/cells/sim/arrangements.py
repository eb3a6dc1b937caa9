"""Random arm pose, image region and objects of a labelled scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.random import Generator

from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cell.config import CameraConfig, CellConfig, Colour, ObjectConfig
from executive.cell.layout import build_bins
from executive.cells.ground_truth import UNKNOWN_LABEL
from executive.cells.sim.models import add_body, build_drop_world, load_mesh, locate_object
from executive.cells.sim.renderer import Region
from executive.cells.sim.variations import draw_object_colour
from executive.cells.sim.world import World, add_bin
from executive.geometry import Array, Pose, make_tool_down_pose, rotate_about_z

MAX_SPARSE_OBJECT_COUNT, MAX_DENSE_OBJECT_COUNT = 7, 20
"""Maximum number of objects in a sparse scene and in a dense scene."""
SCALE_FACTORS = (0.75, 0.8, 0.85, 0.9, 0.95, 1.05, 1.1, 1.15, 1.2, 1.3)
"""Scale factors of objects whose size differs from the size of their class."""
UNKNOWN_MODEL_COUNT, DAMAGED_MODEL_NUMBER = 1000, 168
"""Number of shapes in `random_urdfs` of pybullet_data, and index of the shape with a damaged mesh."""
TRAINING_MODEL_NUMBERS = tuple(number for number in range(800) if number != DAMAGED_MODEL_NUMBER)
"""Indices of the shapes for unknown objects in training; all other shapes are reserved for tests."""
TABLE_X_RANGE, TABLE_Y_RANGE = (-0.05, 0.86), (-0.71, 0.71)
"""Ranges of the x and y coordinates of objects on the table top [m]."""
MIN_BASE_DISTANCE = 0.16
"""Minimum distance of an object from the axis of the base of the arm [m]."""
SETTLING_STEP_COUNT = 360
"""Number of physics steps in which dropped objects come to rest."""


@dataclass(frozen=True, eq=False)
class SceneObject:
    """An object of a scene.

    Attributes:
        label: Class of the object, or `UNKNOWN_LABEL`.
        model: Model of the object, already scaled.
        X_WO: Pose of the object in the world.
        colour: Red, green and blue of the object, each 0 to 1; black if unknown.
    """

    label: str
    model: ObjectConfig
    X_WO: Pose
    colour: Colour = (0.0, 0.0, 0.0)


def move_arm_randomly(world: World, camera: CameraConfig, rng: Generator) -> bool:
    """Move the arm to a random pose of a run, and return True if the tool shall hold an object."""
    poses = camera.scan_poses
    pose = poses[0] if rng.random() < 0.6 else str(rng.choice(poses))
    world.set_joint_positions(np.radians(world.config.arm.poses_deg[pose]))
    is_near_scan_pose = rng.random() < 0.6
    if camera.mount == "wrist":
        max_offset = (0.02, 0.02, 0.02) if is_near_scan_pose else (0.07, 0.15, 0.12)
        max_angle = math.radians(3) if is_near_scan_pose else 0.5
        X_WT = world.get_tool_pose()
        offset = rng.uniform(-1, 1, 3) * max_offset
        tilt = Pose.of(np.zeros(3), [*rng.normal(0, math.radians(1.5), 2) / 2, 0, 1])
        rotation = rotate_about_z(rng.uniform(-max_angle, max_angle)) @ X_WT.rotation
        _move_tool(world, Pose(rotation, X_WT.position + offset) @ tilt)
        return bool(rng.random() < 0.08)
    if is_near_scan_pose:
        return False
    # The inverse kinematics starts from a pose that is closer to all targets than the scan poses.
    position = rng.uniform((0.25, -0.50, 0.05), (0.72, 0.50, 0.40))
    azimuth = math.atan2(position[1], position[0])
    world.set_joint_positions([azimuth, *map(math.radians, world.robot.ik_seed_deg)])
    _move_tool(world, make_tool_down_pose(position, azimuth + rng.uniform(-1.2, 1.2)))
    return bool(rng.random() < 0.3)


def draw_region(camera: CameraConfig, rng: Generator) -> Region:
    """Return the image region of a scene: mostly `table_view`, else a random region of equal size."""
    left, top, right, bottom = camera.table_view
    if rng.random() < 0.65:
        return camera.table_view
    x = int(rng.integers(0, camera.width - (right - left), endpoint=True))
    y = int(rng.integers(0, camera.height - (bottom - top), endpoint=True))
    return x, y, x + right - left, y + bottom - top


def draw_objects(config: CellConfig, count: int, table_colour: Colour, rng: Generator) -> list[SceneObject]:
    """Return `count` random objects at the origin; some scenes contain unknown or scaled objects."""
    unknown_fraction = rng.uniform(0.05, 0.4) if rng.random() < 0.35 else 0.0
    scaled_fraction = rng.uniform(0.2, 1.0) if rng.random() < 0.35 else 0.0
    objects = []
    for label in map(str, rng.choice(list(config.objects), count)):
        model = config.objects[label]
        colour = draw_object_colour(model.colours, table_colour, rng)
        if rng.random() < unknown_fraction:
            label, model = UNKNOWN_LABEL, load_unknown_model(int(rng.choice(TRAINING_MODEL_NUMBERS)))
            model = scale_model(model, rng.uniform(0.4, 1.0))
        elif rng.random() < scaled_fraction:
            model = scale_model(model, float(rng.choice(SCALE_FACTORS)))
        objects.append(SceneObject(label, model, Pose.identity(), colour))
    return objects


def scale_model(model: ObjectConfig, factor: float) -> ObjectConfig:
    """Return the model of an object scaled by `factor`."""
    names = ("scale", "height", "radius", "ring")
    return model.model_copy(update={name: getattr(model, name) * factor for name in names})


@cache
def load_unknown_model(number: int) -> ObjectConfig:
    """Return shape `number` (0 to 999) of `random_urdfs` in pybullet_data; most shapes are 12 cm long."""
    name = f"random_urdfs/{number:03d}/{number:03d}.urdf"
    mesh = load_mesh(ObjectConfig(urdf=name, height=1.0, radius=1.0))
    return ObjectConfig(urdf=name, height=mesh.top - mesh.bottom, radius=mesh.radius)


def draw_arrangement(
    config: CellConfig, footprint: Array, shows_workspace: bool, table_colour: Colour, rng: Generator
) -> list[SceneObject]:
    """Return a random arrangement of 0 to 20 objects, possibly with unknown objects, stacks and heaps.

    Args:
        config: The cell file.
        footprint: Corners `(N, 2)` [m] of the visible part of the table.
        shows_workspace: True to put most objects into or near the workspace.
        table_colour: Mean colour of the table.
        rng: Random number generator.
    """
    max_count = MAX_SPARSE_OBJECT_COUNT if rng.random() < 0.45 else MAX_DENSE_OBJECT_COUNT
    count = int(rng.integers(0, max_count + 1))
    objects = draw_objects(config, count, table_colour, rng)
    low = np.maximum(footprint.min(axis=0), (TABLE_X_RANGE[0], TABLE_Y_RANGE[0]))
    high = np.minimum(footprint.max(axis=0), (TABLE_X_RANGE[1], TABLE_Y_RANGE[1]))
    if (high - low < 0.05).any():
        return []
    if shows_workspace and rng.random() < 0.75:
        # The margin around the workspace grows with the number of objects.
        margin = rng.uniform(0.0, 0.02 + 0.006 * count)
        low = np.maximum(low, np.array([config.table.x[0], config.table.y[0]]) - margin)
        high = np.minimum(high, np.array([config.table.x[1], config.table.y[1]]) + margin)
    all_bins = list(build_bins(config).values())
    bins = [bin for bin in all_bins if _overlaps_rectangle(bin, low, high)]
    random_number = rng.random()
    if random_number < 0.15:
        return simulate_fall(config, _draw_heap(objects[:MAX_SPARSE_OBJECT_COUNT], low, high, bins, rng))
    objects = _place_side_by_side(objects, low, high, bins, all_bins, rng)
    if random_number < 0.23:
        drop_offset = np.array([0, 0, 0.04])
        raised = [replace(o, X_WO=Pose(_draw_rotation(rng), o.X_WO.position + drop_offset)) for o in objects]
        return simulate_fall(config, raised)
    if random_number < 0.40:
        _stack_randomly(objects, rng)
    return objects


def draw_held_object(X_WT: Pose, config: CellConfig, rng: Generator) -> SceneObject:
    """Return a random object that hangs upright at the tip of the tool."""
    (held_object,) = draw_objects(config, 1, (0.5, 0.5, 0.5), rng)
    position = X_WT.position - [0, 0, load_mesh(held_object.model).top]
    return replace(held_object, X_WO=Pose(rotate_about_z(rng.uniform(0, math.tau)), position))


def simulate_fall(config: CellConfig, objects: Sequence[SceneObject]) -> list[SceneObject]:
    """Simulate the fall of objects onto table and bins for 1.5 s, and return the objects at the final poses.

    Each call uses a new physics world, so that the result depends only on the initial poses.
    """
    client = build_drop_world()
    try:
        for bin in config.bins.values():
            add_bin(client, bin)
        bodies = [add_body(client, scene_object.model, scene_object.X_WO) for scene_object in objects]
        for _ in range(SETTLING_STEP_COUNT):
            client.stepSimulation()
        final_objects = []
        for body, scene_object in zip(bodies, objects, strict=True):
            X_WO = locate_object(client, body, scene_object.model)
            final_objects.append(replace(scene_object, X_WO=X_WO))
        return final_objects
    finally:
        client.disconnect()


def _move_tool(world: World, X_WT: Pose) -> None:
    """Move the tool near `X_WT`; the accuracy is unimportant, because labels use the actual camera pose."""
    X_WL = X_WT @ Pose.of([0, 0, -(world.robot.flange_offset + world.config.tool.length)])
    for _ in range(3):  # X_WL is the pose of the flange link
        q = world.client.calculateInverseKinematics(
            world.arm, world.flange_index, X_WL.position, X_WL.quaternion,
            maxNumIterations=60, residualThreshold=1e-4,
        )  # fmt: skip
        world.set_joint_positions(q[: world.robot.joint_count])


def _draw_rotation(rng: Generator) -> Array:
    """Return a random rotation matrix with uniform distribution."""
    return Pose.of(np.zeros(3), rng.normal(size=4)).rotation


def _overlaps_rectangle(bin: Bin, low: Array, high: Array) -> bool:
    """Return True if a bin overlaps the rectangle from `low` to `high` `(2,)` [m] by over 4 cm."""
    centre, half_size = bin.position[:2], bin.size[:2] / 2
    return bool((centre + half_size > low + 0.04).all() and (centre - half_size < high - 0.04).all())


def _draw_heap(
    objects: Sequence[SceneObject], low: Array, high: Array, bins: list[Bin], rng: Generator
) -> list[SceneObject]:
    """Return objects above each other, over a point of the table or over a bin."""
    if bins and rng.random() < 0.6:
        centre = bins[int(rng.integers(len(bins)))].position[:2]
    else:
        centre = rng.uniform(low + 0.03, np.maximum(high - 0.03, low + 0.031))
    std = rng.uniform(0.01, 0.06)
    heights = 0.05 + 0.055 * np.arange(len(objects))
    positions = [np.array([*(centre + rng.normal(0, std, 2)), height]) for height in heights]
    pairs = zip(objects, positions, strict=True)
    return [replace(item, X_WO=Pose(_draw_rotation(rng), position)) for item, position in pairs]


def _stack_randomly(objects: list[SceneObject], rng: Generator) -> None:
    """Put some objects nearly centred on others; the stability of the stacks is not simulated."""
    for _ in range(int(rng.integers(1, 1 + max(1, len(objects) // 3)))):
        if len(objects) < 2:
            return
        upper, lower = (int(index) for index in rng.choice(len(objects), 2, replace=False))
        lower_object = objects[lower]
        point = lower_object.X_WO.position[:2]
        distances = [math.dist(item.X_WO.position[:2], point) for item in objects if item is not lower_object]
        if min(distances) < 0.01:
            continue
        height = load_mesh(lower_object.model).top - load_mesh(objects[upper].model).bottom
        position = lower_object.X_WO.position + np.array([*rng.normal(0, 0.003, 2), height])
        X_WO = Pose(rotate_about_z(rng.uniform(0, math.tau)), position)
        objects[upper] = replace(objects[upper], X_WO=X_WO)


def _place_side_by_side(
    objects: list[SceneObject], low: Array, high: Array, bins: list[Bin], all_bins: list[Bin], rng: Generator
) -> list[SceneObject]:
    """Return objects at random free positions on the table or in `bins`; objects without room are omitted."""
    gap = rng.uniform(0.0, 0.02)
    placed_objects: list[SceneObject] = []
    for candidate in objects:
        radius = candidate.model.radius
        for _ in range(30):
            point, floor_height = rng.uniform(low, high), 0.0
            if bins and rng.random() < 0.35:
                bin = bins[int(rng.integers(len(bins)))]
                max_offset = np.maximum(bin.size[:2] / 2 - radius, 0.0)
                point = bin.position[:2] + rng.uniform(-max_offset, max_offset)
            bins_at_point = [bin for bin in all_bins if bin.contains(point, -radius)]
            if bins_at_point:
                floor_height = bins_at_point[0].position[2] + BIN_THICKNESS
            elif any(bin.contains(point, radius + BIN_THICKNESS) for bin in all_bins):
                continue
            is_free = all(
                np.linalg.norm(item.X_WO.position[:2] - point) > radius + item.model.radius + gap
                for item in placed_objects
            )
            if is_free and np.linalg.norm(point) > MIN_BASE_DISTANCE:
                position = np.array([*point, floor_height - load_mesh(candidate.model).bottom])
                X_WO = Pose(rotate_about_z(rng.uniform(0, math.tau)), position)
                placed_objects.append(replace(candidate, X_WO=X_WO))
                break
    return placed_objects
