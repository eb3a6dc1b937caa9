"""Random arm pose, image region and objects of a labelled scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pybullet
from numpy.random import Generator
from pybullet_utils.bullet_client import BulletClient

from executive.cell.bins import BIN_THICKNESS
from executive.cell.clock import STEP
from executive.cell.config import BinConfig, CameraConfig, CellConfig, Colour, ObjectConfig
from executive.cells.audit import UNKNOWN_LABEL
from executive.cells.sim.camera import Region
from executive.cells.sim.models import add_body, compute_upright_pose, load_mesh
from executive.cells.sim.variations import draw_object_colour
from executive.cells.sim.world import World, add_bin
from executive.geometry import Array, Pose, make_tool_down_pose, rotate_about_z, rotation_from_quaternion

MAX_SPARSE_COUNT, MAX_DENSE_COUNT = 7, 20
"""Maximum number of objects in a sparse scene and in a dense scene."""
SCALE_FACTORS = (0.75, 0.8, 0.85, 0.9, 0.95, 1.05, 1.1, 1.15, 1.2, 1.3)
"""Scale factors of objects whose size differs from that of their class."""
UNKNOWN_MODEL_COUNT, DAMAGED_MODEL = 1000, 168
"""Number of the shapes in `random_urdfs` of pybullet_data, and index of the shape with a damaged mesh."""
TRAINING_MODEL_NUMBERS = tuple(number for number in range(800) if number != DAMAGED_MODEL)
"""Indices of the shapes used as unknown objects; the others are reserved for tests."""
TABLE_X_RANGE, TABLE_Y_RANGE = (-0.05, 0.86), (-0.71, 0.71)
"""Ranges of the positions of objects on the table top [m]."""
BASE_RADIUS = 0.16
"""Radius around the base of the arm without objects [m]."""
SETTLING_STEP_COUNT = 360
"""Number of physics steps in which dropped objects come to rest."""


@dataclass(frozen=True, eq=False)
class SceneObject:
    """An object of a scene.

    Attributes:
        label: Class of the object, or `UNKNOWN_LABEL`.
        model: Model of the object, already scaled.
        X_WO: Pose of the object.
        colour: Colour of the object.
    """

    label: str
    model: ObjectConfig
    X_WO: Pose
    colour: Colour


def move_arm_randomly(world: World, camera: CameraConfig, rng: Generator) -> bool:
    """Move the arm to a random pose as in a run; return True if the tool shall hold an object."""
    poses = world.config.arm.poses_deg
    scans = camera.scan_poses
    scan = np.radians(poses[scans[0] if rng.random() < 0.6 else str(rng.choice(scans))])
    world.set_joint_positions(scan)
    is_close_to_scan = rng.random() < 0.6
    if camera.mount == "wrist":
        max_offset = (0.02, 0.02, 0.02) if is_close_to_scan else (0.07, 0.15, 0.12)
        max_angle = math.radians(3) if is_close_to_scan else 0.5
        X_WT = world.get_tool_pose()
        offset = rng.uniform(-1, 1, 3) * max_offset
        tilt = Pose.of(np.zeros(3), [*rng.normal(0, math.radians(1.5), 2) / 2, 0, 1])
        rotation = rotate_about_z(rng.uniform(-max_angle, max_angle)) @ X_WT.rotation
        _move_tool(world, Pose(rotation, X_WT.position + offset) @ tilt)
        return bool(rng.random() < 0.08)
    if is_close_to_scan:
        return False
    # The inverse kinematics starts from a pose that is closer to all targets than the scan poses.
    position = rng.uniform((0.25, -0.50, 0.05), (0.72, 0.50, 0.40))
    azimuth = math.atan2(position[1], position[0])
    world.set_joint_positions([azimuth, *map(math.radians, world.robot.forward_pose_deg)])
    _move_tool(world, make_tool_down_pose(position, azimuth + rng.uniform(-1.2, 1.2)))
    return bool(rng.random() < 0.3)


def draw_region(camera: CameraConfig, rng: Generator) -> Region:
    """Return the image region of a scene: mostly `table_view`, else a random region of the same size."""
    left, top, right, bottom = camera.table_view
    if rng.random() < 0.65:
        return camera.table_view
    x = int(rng.integers(0, camera.width - (right - left), endpoint=True))
    y = int(rng.integers(0, camera.height - (bottom - top), endpoint=True))
    return x, y, x + right - left, y + bottom - top


def draw_objects(config: CellConfig, count: int, table: Colour, rng: Generator) -> list[SceneObject]:
    """Return `count` random objects at the origin; in some scenes, objects are unknown or of other sizes."""
    unknown_fraction = rng.uniform(0.05, 0.4) if rng.random() < 0.35 else 0.0
    scaled_fraction = rng.uniform(0.2, 1.0) if rng.random() < 0.35 else 0.0
    objects = []
    for label in rng.choice(list(config.objects), count):
        label, model = str(label), config.objects[str(label)]
        colour = draw_object_colour(model.colours, table, rng)
        if rng.random() < unknown_fraction:
            label, model = UNKNOWN_LABEL, load_unknown_model(int(rng.choice(TRAINING_MODEL_NUMBERS)))
            model = scale_model(model, rng.uniform(0.4, 1.0))
        elif rng.random() < scaled_fraction:
            model = scale_model(model, float(rng.choice(SCALE_FACTORS)))
        objects.append(SceneObject(label, model, Pose.identity(), colour))
    return objects


def scale_model(model: ObjectConfig, factor: float) -> ObjectConfig:
    """Return a model that is `factor` times as large."""
    names = ("scale", "height", "radius", "ring")
    return model.model_copy(update={name: getattr(model, name) * factor for name in names})


@cache
def load_unknown_model(number: int) -> ObjectConfig:
    """Return a shape of `random_urdfs` of pybullet_data by its number, 0 to 999; most are 12 cm long."""
    name = f"random_urdfs/{number:03d}/{number:03d}.urdf"
    mesh = load_mesh(ObjectConfig(urdf=name, height=1.0, radius=1.0))
    return ObjectConfig(urdf=name, height=mesh.top - mesh.bottom, radius=mesh.radius)


def draw_arrangement(
    config: CellConfig, footprint: Array, shows_workspace: bool, table: Colour, rng: Generator
) -> list[SceneObject]:
    """Return a random arrangement of 0 to 20 objects, possibly with unknown objects, stacks and heaps.

    Args:
        config: The cell file.
        footprint: Corners `(N, 2)` [m] of the visible part of the table.
        shows_workspace: True if the image shows the workspace; most objects then lie in or near it.
        table: Mean colour of the table.
        rng: Random number generator.
    """
    count = int(rng.integers(0, (MAX_SPARSE_COUNT if rng.random() < 0.45 else MAX_DENSE_COUNT) + 1))
    objects = draw_objects(config, count, table, rng)
    low = np.maximum(footprint.min(axis=0), (TABLE_X_RANGE[0], TABLE_Y_RANGE[0]))
    high = np.minimum(footprint.max(axis=0), (TABLE_X_RANGE[1], TABLE_Y_RANGE[1]))
    if (high - low < 0.05).any():
        return []
    if shows_workspace and rng.random() < 0.75:
        # The margin around the workspace grows with the number of objects.
        margin = rng.uniform(0.0, 0.02 + 0.006 * count)
        low = np.maximum(low, np.array([config.table.x[0], config.table.y[0]]) - margin)
        high = np.minimum(high, np.array([config.table.x[1], config.table.y[1]]) + margin)
    bins = [bin for bin in config.bins.values() if _overlaps(bin, low, high)]
    choice = rng.random()
    if choice < 0.15:
        return drop_objects(config, _draw_heap(objects[:MAX_SPARSE_COUNT], low, high, bins, rng))
    objects = _place_side_by_side(config, objects, low, high, bins, rng)
    if choice < 0.23:
        return drop_objects(config, [_lift_and_rotate(one, rng) for one in objects])
    if choice < 0.40:
        _stack_randomly(objects, rng)
    return objects


def _lift_and_rotate(lying: SceneObject, rng: Generator) -> SceneObject:
    """Return an object lifted by 4 cm and randomly rotated."""
    return replace(lying, X_WO=Pose(_draw_rotation(rng), lying.X_WO.position + np.array([0, 0, 0.04])))


def draw_held_object(X_WT: Pose, config: CellConfig, rng: Generator) -> SceneObject:
    """Return a random object that hangs upright at the tip of the tool."""
    (held,) = draw_objects(config, 1, (0.5, 0.5, 0.5), rng)
    position = X_WT.position - [0, 0, load_mesh(held.model).top]
    return replace(held, X_WO=Pose(rotate_about_z(rng.uniform(0, math.tau)), position))


def drop_objects(config: CellConfig, objects: Sequence[SceneObject]) -> list[SceneObject]:
    """Return objects at their simulated poses 1.5 s after their release.

    Each call uses a new physics world, so that the result depends only on the initial poses.
    """
    client = BulletClient(pybullet.DIRECT)
    try:
        client.setGravity(0, 0, -9.81)
        client.setTimeStep(STEP)
        client.setPhysicsEngineParameter(deterministicOverlappingPairs=1)
        table = client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[2, 2, 0.5])
        client.createMultiBody(0, table, basePosition=[0, 0, -0.5])
        for bin in config.bins.values():
            add_bin(client, bin)
        bodies = [add_body(client, one.model, one.X_WO) for one in objects]
        for _ in range(SETTLING_STEP_COUNT):
            client.stepSimulation()
        pairs = zip(bodies, objects, strict=True)
        return [replace(one, X_WO=_get_object_pose(client, body, one.model)) for body, one in pairs]
    finally:
        client.disconnect()


def _get_object_pose(client: BulletClient, body: int, model: ObjectConfig) -> Pose:
    X_LI = Pose.of(*client.getDynamicsInfo(body, -1)[3:5])
    X_WI = Pose.of(*client.getBasePositionAndOrientation(body))
    return X_WI @ (compute_upright_pose(model) @ X_LI).inverse()


def _move_tool(world: World, X_WT: Pose) -> None:
    """Move the tool near `X_WT`; an error does not matter, because labels use the actual camera pose."""
    X_WE = X_WT @ Pose.of([0, 0, -(world.robot.flange_offset + world.config.tool.length)])
    for _ in range(3):
        q = world.client.calculateInverseKinematics(
            world.arm, world.flange_index, X_WE.position, X_WE.quaternion,
            maxNumIterations=60, residualThreshold=1e-4,
        )  # fmt: skip
        world.set_joint_positions(q[: world.robot.joint_count])


def _draw_rotation(rng: Generator) -> Array:
    return rotation_from_quaternion(rng.normal(size=4))


def _overlaps(bin: BinConfig, low: Array, high: Array) -> bool:
    """Return True if a bin overlaps the rectangle from `low` to `high` `(2,)` [m] by at least 4 cm."""
    half_size = np.array(bin.size[:2]) / 2
    centre = np.array(bin.position[:2])
    return bool((centre + half_size > low + 0.04).all() and (centre - half_size < high - 0.04).all())


def _contains(bin: BinConfig, point: Array, margin: float) -> bool:
    """Return True if a point `(2,)` [m] is inside the outline of a bin, enlarged by a margin [m]."""
    return bool((np.abs(point - bin.position[:2]) < np.array(bin.size[:2]) / 2 + margin).all())


def _draw_heap(
    objects: Sequence[SceneObject], low: Array, high: Array, bins: list[BinConfig], rng: Generator
) -> list[SceneObject]:
    """Return objects one above the other, over a point of the table or over a bin."""
    if bins and rng.random() < 0.6:
        centre = np.array(bins[int(rng.integers(len(bins)))].position[:2])
    else:
        centre = rng.uniform(low + 0.03, np.maximum(high - 0.03, low + 0.031))
    std = rng.uniform(0.01, 0.06)
    positions = [[*(centre + rng.normal(0, std, 2)), 0.05 + 0.055 * i] for i in range(len(objects))]
    return [
        replace(one, X_WO=Pose(_draw_rotation(rng), np.array(position)))
        for one, position in zip(objects, positions, strict=True)
    ]


def _stack_randomly(objects: list[SceneObject], rng: Generator) -> None:
    """Put some objects on others, nearly centred; the balance of the stacks is not simulated."""
    for _ in range(int(rng.integers(1, 1 + max(1, len(objects) // 3)))):
        if len(objects) < 2:
            return
        upper, lower = (int(index) for index in rng.choice(len(objects), 2, replace=False))
        base = objects[lower]
        point = base.X_WO.position[:2]
        if any(math.dist(one.X_WO.position[:2], point) < 0.01 for one in objects if one is not base):
            continue
        height = load_mesh(base.model).top - load_mesh(objects[upper].model).bottom
        position = base.X_WO.position + np.array([*rng.normal(0, 0.003, 2), height])
        X_WO = Pose(rotate_about_z(rng.uniform(0, math.tau)), position)
        objects[upper] = replace(objects[upper], X_WO=X_WO)


def _place_side_by_side(
    config: CellConfig,
    objects: Sequence[SceneObject],
    low: Array,
    high: Array,
    bins: list[BinConfig],
    rng: Generator,
) -> list[SceneObject]:
    """Return objects at random free positions on the table or in `bins`, without those that find no room."""
    gap = rng.uniform(0.0, 0.02)
    placed: list[SceneObject] = []
    for candidate in objects:
        radius = candidate.model.radius
        for _ in range(30):
            point, floor = rng.uniform(low, high), 0.0
            if bins and rng.random() < 0.35:
                bin = bins[int(rng.integers(len(bins)))]
                max_offset = np.maximum(np.array(bin.size[:2]) / 2 - radius, 0.0)
                point = np.array(bin.position[:2]) + rng.uniform(-max_offset, max_offset)
            containing = [bin for bin in config.bins.values() if _contains(bin, point, -radius)]
            if containing:
                floor = containing[0].position[2] + BIN_THICKNESS
            elif any(_contains(bin, point, radius + BIN_THICKNESS) for bin in config.bins.values()):
                continue
            is_free = all(
                np.linalg.norm(other.X_WO.position[:2] - point) > radius + other.model.radius + gap
                for other in placed
            )
            if is_free and np.linalg.norm(point) > BASE_RADIUS:
                position = np.array([*point, floor - load_mesh(candidate.model).bottom])
                placed.append(
                    replace(candidate, X_WO=Pose(rotate_about_z(rng.uniform(0, math.tau)), position))
                )
                break
    return placed
