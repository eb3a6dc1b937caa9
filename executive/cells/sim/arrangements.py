"""Random arm, view and objects of a labelled scene."""

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
from executive.cells.audit import UNKNOWN
from executive.cells.sim.models import add_body, compute_upright_pose, load_mesh
from executive.cells.sim.variations import random_object_colour
from executive.cells.sim.world import World, add_bin
from executive.geometry import Array, Pose, make_tool_down_pose, rotate_about_z, rotation_from_quaternion

MAX_OBJECTS_SPARSE, MAX_OBJECTS_DENSE = 7, 20
"""Largest number of objects in a sparse scene and in a dense scene."""
SCALES = (0.75, 0.8, 0.85, 0.9, 0.95, 1.05, 1.1, 1.15, 1.2, 1.3)
"""Scale factors of objects whose size differs from that of their class."""
UNKNOWN_COUNT, DAMAGED_MODEL = 1000, 168
"""Count of the shapes in pybullet_data's `random_urdfs`, and number of the shape with a damaged mesh."""
UNKNOWN_MODELS = tuple(number for number in range(800) if number != DAMAGED_MODEL)
"""Numbers of the shapes used as unknown objects; the others are left for tests."""
TABLE_X, TABLE_Y = (-0.05, 0.86), (-0.71, 0.71)
"""Part of the table top where objects may lie [m]."""
BASE_CLEARANCE = 0.16
"""Radius around the arm's base kept free [m]."""
SETTLING_STEPS = 360
"""Number of physics steps in which objects settle."""


@dataclass(frozen=True, eq=False)
class SceneObject:
    """An object of a scene.

    Attributes:
        label: Class of the object, or `UNKNOWN`.
        model: Model of the object, already scaled.
        X_WO: Pose of the object.
        colour: Colour of the object.
    """

    label: str
    model: ObjectConfig
    X_WO: Pose
    colour: Colour


def move_arm(world: World, camera: CameraConfig, rng: Generator) -> bool:
    """Move the arm to a random pose as in a run; return True if the arm is to hold an object."""
    poses = world.config.arm.poses_deg
    scans = camera.scan_poses
    scan = np.radians(poses[scans[0] if rng.random() < 0.6 else str(rng.choice(scans))])
    world.set_joint_positions(scan)
    usual = rng.random() < 0.6
    if camera.mount == "wrist":
        spread = (0.02, 0.02, 0.02) if usual else (0.07, 0.15, 0.12)
        turn = math.radians(3) if usual else 0.5
        X_WT = world.get_tool_pose()
        offset = rng.uniform(-1, 1, 3) * spread
        tilt = Pose.of(np.zeros(3), [*rng.normal(0, math.radians(1.5), 2) / 2, 0, 1])
        turned = Pose(rotate_about_z(rng.uniform(-turn, turn)) @ X_WT.rotation, X_WT.position + offset)
        _move_tool(world, turned @ tilt)
        return bool(rng.random() < 0.08)
    if usual:
        return False
    # The inverse kinematics starts from a forward posture, nearer to all targets than a scan pose.
    position = rng.uniform((0.25, -0.50, 0.05), (0.72, 0.50, 0.40))
    bearing = math.atan2(position[1], position[0])
    world.set_joint_positions([bearing, *map(math.radians, world.robot.forward_pose_deg)])
    _move_tool(world, make_tool_down_pose(position, bearing + rng.uniform(-1.2, 1.2)))
    return bool(rng.random() < 0.3)


def random_part(camera: CameraConfig, rng: Generator) -> tuple[int, int, int, int]:
    """Return the part of the image to show: mostly `table_view`, else another of the same size."""
    left, top, right, bottom = camera.table_view
    if rng.random() < 0.65:
        return camera.table_view
    x = int(rng.integers(0, camera.width - (right - left), endpoint=True))
    y = int(rng.integers(0, camera.height - (bottom - top), endpoint=True))
    return x, y, x + right - left, y + bottom - top


def draw_items(config: CellConfig, count: int, table: Colour, rng: Generator) -> list[SceneObject]:
    """Return `count` random objects at the origin; some scenes have unknown objects or other sizes."""
    share_unknown = rng.uniform(0.05, 0.4) if rng.random() < 0.35 else 0.0
    share_resized = rng.uniform(0.2, 1.0) if rng.random() < 0.35 else 0.0
    items = []
    for label in rng.choice(list(config.objects), count):
        label, model = str(label), config.objects[str(label)]
        colour = random_object_colour(model.colours, table, rng)
        if rng.random() < share_unknown:
            label, model = UNKNOWN, unknown_model(int(rng.choice(UNKNOWN_MODELS)))
            model = resize(model, rng.uniform(0.4, 1.0))
        elif rng.random() < share_resized:
            model = resize(model, float(rng.choice(SCALES)))
        items.append(SceneObject(label, model, Pose.identity(), colour))
    return items


def resize(model: ObjectConfig, factor: float) -> ObjectConfig:
    """Return a model `factor` times as large."""
    names = ("scale", "height", "radius", "ring")
    return model.model_copy(update={name: getattr(model, name) * factor for name in names})


@cache
def unknown_model(number: int) -> ObjectConfig:
    """Return one of pybullet_data's 1,000 random shapes, most of them 12 cm long; `number` is 0 to 999."""
    name = f"random_urdfs/{number:03d}/{number:03d}.urdf"
    mesh = load_mesh(ObjectConfig(urdf=name, height=1.0, radius=1.0))
    return ObjectConfig(urdf=name, height=mesh.top - mesh.bottom, radius=mesh.radius)


def arrange(
    config: CellConfig, footprint: Array, shows_workspace: bool, table: Colour, rng: Generator
) -> list[SceneObject]:
    """Return a random arrangement of 0 to 20 objects; unknown objects and stacks may be among them.

    Args:
        config: The cell.
        footprint: Corners `(N, 2)` [m] of the part of the table in the image.
        shows_workspace: True if the image shows the workspace: then objects mostly lie in or near it.
        table: Mean colour of the table.
        rng: Random number generator.
    """
    count = int(rng.integers(0, (MAX_OBJECTS_SPARSE if rng.random() < 0.45 else MAX_OBJECTS_DENSE) + 1))
    items = draw_items(config, count, table, rng)
    low = np.maximum(footprint.min(axis=0), (TABLE_X[0], TABLE_Y[0]))
    high = np.minimum(footprint.max(axis=0), (TABLE_X[1], TABLE_Y[1]))
    if (high - low < 0.05).any():
        return []
    if shows_workspace and rng.random() < 0.75:
        # The more objects, the more room around the workspace they get.
        margin = rng.uniform(0.0, 0.02 + 0.006 * count)
        low = np.maximum(low, np.array([config.table.x[0], config.table.y[0]]) - margin)
        high = np.minimum(high, np.array([config.table.x[1], config.table.y[1]]) + margin)
    in_view = [bin for bin in config.bins.values() if _overlaps(bin, low, high)]
    style = rng.random()
    if style < 0.15:
        return settle(config, _heap(items[:MAX_OBJECTS_SPARSE], low, high, in_view, rng))
    items = _place_side_by_side(config, items, low, high, in_view, rng)
    if style < 0.23:
        return settle(config, [_lift_and_rotate(item, rng) for item in items])
    if style < 0.40:
        _stack(items, rng)
    return items


def _lift_and_rotate(item: SceneObject, rng: Generator) -> SceneObject:
    """Return an object lifted by 4 cm and randomly rotated."""
    return replace(item, X_WO=Pose(_random_rotation(rng), item.X_WO.position + np.array([0, 0, 0.04])))


def make_held_object(X_WT: Pose, config: CellConfig, rng: Generator) -> SceneObject:
    """Return a random object that hangs upright at the tip of the tool."""
    (item,) = draw_items(config, 1, (0.5, 0.5, 0.5), rng)
    place = X_WT.position - [0, 0, load_mesh(item.model).top]
    return replace(item, X_WO=Pose(rotate_about_z(rng.uniform(0, math.tau)), place))


def settle(config: CellConfig, items: Sequence[SceneObject]) -> list[SceneObject]:
    """Return objects at their poses 1.5 s after release.

    A new physics world for each call makes the result a function of the start poses alone.
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
        bodies = [add_body(client, item.model, item.X_WO) for item in items]
        for _ in range(SETTLING_STEPS):
            client.stepSimulation()
        settled = zip(bodies, items, strict=True)
        return [replace(item, X_WO=_pose_of(client, body, item)) for body, item in settled]
    finally:
        client.disconnect()


def _pose_of(client: BulletClient, body: int, item: SceneObject) -> Pose:
    X_LI = Pose.of(*client.getDynamicsInfo(body, -1)[3:5])
    X_WI = Pose.of(*client.getBasePositionAndOrientation(body))
    return X_WI @ (compute_upright_pose(item.model) @ X_LI).inverse()


def _move_tool(world: World, X_WT: Pose) -> None:
    """Move the tool near `X_WT`; the residual error is harmless: the camera pose is read later."""
    X_WE = X_WT @ Pose.of([0, 0, -(world.robot.flange_offset + world.config.tool.length)])
    for _ in range(3):
        q = world.client.calculateInverseKinematics(
            world.arm, world.flange, X_WE.position, X_WE.quaternion,
            maxNumIterations=60, residualThreshold=1e-4,
        )  # fmt: skip
        world.set_joint_positions(q[: world.robot.joint_count])


def _random_rotation(rng: Generator) -> Array:
    return rotation_from_quaternion(rng.normal(size=4))


def _overlaps(bin: BinConfig, low: Array, high: Array) -> bool:
    half = np.array(bin.size[:2]) / 2
    centre = np.array(bin.position[:2])
    return bool((centre + half > low + 0.04).all() and (centre - half < high - 0.04).all())


def _inside(bin: BinConfig, point: Array, margin: float) -> bool:
    return bool((np.abs(point - bin.position[:2]) < np.array(bin.size[:2]) / 2 + margin).all())


def _heap(
    items: Sequence[SceneObject], low: Array, high: Array, bins: list[BinConfig], rng: Generator
) -> list[SceneObject]:
    """Return objects one above the other, over a point of the table or over a bin."""
    if bins and rng.random() < 0.6:
        centre = np.array(bins[int(rng.integers(len(bins)))].position[:2])
    else:
        centre = rng.uniform(low + 0.03, np.maximum(high - 0.03, low + 0.031))
    spread = rng.uniform(0.01, 0.06)
    places = [[*(centre + rng.normal(0, spread, 2)), 0.05 + 0.055 * i] for i in range(len(items))]
    return [
        replace(item, X_WO=Pose(_random_rotation(rng), np.array(place)))
        for item, place in zip(items, places, strict=True)
    ]


def _stack(items: list[SceneObject], rng: Generator) -> None:
    """Put some objects on others, nearly centred; the balance of the stacks is not simulated."""
    for _ in range(int(rng.integers(1, 1 + max(1, len(items) // 3)))):
        if len(items) < 2:
            return
        upper, lower = (int(index) for index in rng.choice(len(items), 2, replace=False))
        below = items[lower]
        place = below.X_WO.position[:2]
        if any(math.dist(item.X_WO.position[:2], place) < 0.01 for item in items if item is not below):
            continue
        height = load_mesh(below.model).top - load_mesh(items[upper].model).bottom
        offset = np.array([*rng.normal(0, 0.003, 2), height])
        items[upper] = replace(
            items[upper], X_WO=Pose(rotate_about_z(rng.uniform(0, math.tau)), below.X_WO.position + offset)
        )


def _place_side_by_side(
    config: CellConfig,
    items: Sequence[SceneObject],
    low: Array,
    high: Array,
    bins: list[BinConfig],
    rng: Generator,
) -> list[SceneObject]:
    """Place objects side by side on the table or in bins; return those that find a place."""
    gap = rng.uniform(0.0, 0.02)
    placed: list[SceneObject] = []
    for item in items:
        radius = item.model.radius
        for _ in range(30):
            point, floor = rng.uniform(low, high), 0.0
            if bins and rng.random() < 0.35:
                bin = bins[int(rng.integers(len(bins)))]
                half = np.maximum(np.array(bin.size[:2]) / 2 - radius, 0.0)
                point = np.array(bin.position[:2]) + rng.uniform(-half, half)
            inside = [bin for bin in config.bins.values() if _inside(bin, point, -radius)]
            if inside:
                floor = inside[0].position[2] + BIN_THICKNESS
            elif any(_inside(bin, point, radius + BIN_THICKNESS) for bin in config.bins.values()):
                continue
            free = all(
                np.linalg.norm(other.X_WO.position[:2] - point) > radius + other.model.radius + gap
                for other in placed
            )
            if free and np.linalg.norm(point) > BASE_CLEARANCE:
                place = np.array([*point, floor - load_mesh(item.model).bottom])
                placed.append(replace(item, X_WO=Pose(rotate_about_z(rng.uniform(0, math.tau)), place)))
                break
    return placed
