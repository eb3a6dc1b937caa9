"""What is random in a labelled scene: arm, view, objects, colours and light.

The spread is wider than what a mission meets, so that a mission lies well inside it.
"""

from __future__ import annotations

import colorsys
import math
from collections.abc import Mapping, Sequence

import numpy as np
import pybullet
from pybullet_utils.bullet_client import BulletClient

from executive.cell_config import BinConfig, CameraConfig, CellConfig, Colour
from executive.clock import STEP
from executive.geometry import Array, Pose, about_z, rotation_from_quaternion, tool_down
from executive.messages import BIN_THICKNESS
from executive.motion.kinematics import FLANGE_OFFSET
from executive.sim.camera import CELL_LIGHT, Light
from executive.sim.models import Mesh, add_body, upright
from executive.sim.world import World, add_bin

COUNTS = (0.08, 0.14, 0.17, 0.17, 0.15, 0.13, 0.10, 0.06)
"""Probability of 0, 1, … 7 objects."""
TABLE_X, TABLE_Y = (-0.05, 0.86), (-0.71, 0.71)
"""Part of the table top where objects may lie [m]."""
FOOT = 0.16
"""Radius around the arm's foot kept free [m]."""
SETTLING = 360
"""Physics steps after which a pile is taken as it is."""

Item = tuple[str, Pose, Colour]
"""Label, `X_WO` and colour of an object."""


def reach(world: World, camera: CameraConfig, rng: np.random.Generator) -> bool:
    """Put the arm somewhere a run would have it, and tell whether it shall hold an object."""
    poses = world.config.arm.poses_deg
    scans = camera.scan_poses
    scan = np.radians(poses[scans[0] if rng.random() < 0.6 else str(rng.choice(scans))])
    world.set_arm(scan)
    usual = rng.random() < 0.6
    if camera.mount == "wrist":
        spread = (0.02, 0.02, 0.02) if usual else (0.07, 0.15, 0.12)
        turn = math.radians(3) if usual else 0.5
        X_WT = world.tool_pose()
        offset = rng.uniform(-1, 1, 3) * spread
        tilt = Pose.of(np.zeros(3), [*rng.normal(0, math.radians(1.5), 2) / 2, 0, 1])
        turned = Pose(about_z(rng.uniform(-turn, turn)) @ X_WT.rotation, X_WT.position + offset)
        _solve(world, turned @ tilt)
        return bool(rng.random() < 0.08)
    if usual:
        return False
    # From an arm stretched forwards, not from where the camera has it waiting, every reach is short.
    position = rng.uniform((0.25, -0.50, 0.05), (0.72, 0.50, 0.40))
    bearing = math.atan2(position[1], position[0])
    world.set_arm([bearing, math.radians(30), 0, math.radians(-85), 0, math.radians(65), 0])
    _solve(world, tool_down(position, bearing + rng.uniform(-1.2, 1.2)))
    return bool(rng.random() < 0.3)


def random_part(camera: CameraConfig, rng: np.random.Generator) -> tuple[int, int, int, int]:
    """Return the part of the image to show: mostly `table_view`, else another of the same size."""
    left, top, right, bottom = camera.table_view
    if rng.random() < 0.65:
        return camera.table_view
    x = int(rng.integers(0, camera.width - (right - left), endpoint=True))
    y = int(rng.integers(0, camera.height - (bottom - top), endpoint=True))
    return x, y, x + right - left, y + bottom - top


def random_light(rng: np.random.Generator) -> Light:
    """Return the cell's lamp, or another one; three in ten throw shadows."""
    shadow = bool(rng.random() < 0.3)
    if rng.random() < 0.3:
        return Light(shadow=shadow) if shadow else CELL_LIGHT
    azimuth, elevation = rng.uniform(0, math.tau), rng.uniform(math.radians(30), math.pi / 2)
    across = math.cos(elevation)
    red, green, blue = rng.uniform(0.82, 1.0, 3)
    return Light(
        direction=(across * math.cos(azimuth), across * math.sin(azimuth), math.sin(elevation)),
        colour=(red, green, blue),
        ambient=rng.uniform(0.40, 0.70),
        diffuse=rng.uniform(0.20, 0.50),
        specular=rng.uniform(0.0, 0.30),
        shadow=shadow,
    )


def random_tint(rng: np.random.Generator) -> Colour:
    """Return the table's tint: none in half of the scenes."""
    if rng.random() < 0.5:
        return 1.0, 1.0, 1.0
    red, green, blue = rng.uniform(0.75, 1.0) * rng.uniform(0.88, 1.0, 3)
    return red, green, blue


def random_colour(config: CellConfig, label: str, rng: np.random.Generator) -> Colour:
    """Return a colour of an object: of its class' palette, any hue, or a grey from black to white."""
    kind = rng.random()
    if kind < 0.45:
        colours = config.objects[label].colours
        return colours[int(rng.integers(len(colours)))]
    if kind < 0.85:
        return colorsys.hsv_to_rgb(rng.random(), rng.uniform(0.3, 1.0), rng.uniform(0.25, 1.0))
    grey = rng.uniform(0.05, 1.0)
    return grey, grey, grey


def arrange(
    config: CellConfig,
    meshes: Mapping[str, Mesh],
    footprint: Array,
    plain_view: bool,
    rng: np.random.Generator,
) -> list[Item]:
    """Return a random arrangement of 0 to 7 objects.

    Args:
        config: The cell.
        meshes: Shape of each class.
        footprint: Corners `(N, 2)` [m] of what the image shows of the table.
        plain_view: True where the image shows the workspace: then most objects lie there.
        rng: Source of everything random.
    """
    labels = [str(label) for label in rng.choice(list(meshes), rng.choice(len(COUNTS), p=COUNTS))]
    low = np.maximum(footprint.min(axis=0), (TABLE_X[0], TABLE_Y[0]))
    high = np.minimum(footprint.max(axis=0), (TABLE_X[1], TABLE_Y[1]))
    if (high - low < 0.05).any():
        return []
    if plain_view and rng.random() < 0.75:
        margin = rng.uniform(0.0, 0.06)
        low = np.array([config.table.x[0], config.table.y[0]]) - margin
        high = np.array([config.table.x[1], config.table.y[1]]) + margin
    in_view = [bin for bin in config.bins.values() if _overlaps(bin, low, high)]
    style = rng.random()
    if style < 0.20:
        starts = _heap(labels, low, high, in_view, rng)
        poses = settle(config, list(zip(labels, starts, strict=True)))
    else:
        labels, poses = _spread(config, meshes, labels, low, high, in_view, rng)
        if style < 0.28:
            tumbling = [Pose(_any_rotation(rng), pose.position + np.array([0, 0, 0.04])) for pose in poses]
            poses = settle(config, list(zip(labels, tumbling, strict=True)))
    items = zip(labels, poses, strict=True)
    return [(label, pose, random_colour(config, label, rng)) for label, pose in items]


def hanging(X_WT: Pose, meshes: Mapping[str, Mesh], config: CellConfig, rng: np.random.Generator) -> Item:
    """Return a random object that hangs upright at the tool's tip."""
    label = str(rng.choice(list(meshes)))
    place = X_WT.position - [0, 0, meshes[label].top]
    pose = Pose(about_z(rng.uniform(0, math.tau)), place)
    return label, pose, random_colour(config, label, rng)


def settle(config: CellConfig, objects: Sequence[tuple[str, Pose]]) -> list[Pose]:
    """Return where objects (label, `X_WO`) come to lie 1.5 s after they are let go.

    A fresh world every time makes the outcome a function of the starting poses alone.
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
        poses = []
        for label, X_WO in objects:
            body = add_body(client, config.objects[label], X_WO)
            X_LI = Pose.of(*client.getDynamicsInfo(body, -1)[3:5])
            poses.append((body, (upright(config.objects[label]) @ X_LI).inverse()))
        for _ in range(SETTLING):
            client.stepSimulation()
        return [Pose.of(*client.getBasePositionAndOrientation(body)) @ X_IO for body, X_IO in poses]
    finally:
        client.disconnect()


def _solve(world: World, X_WT: Pose) -> None:
    """Bring the tool near `X_WT`; a rest of error does no harm, the camera's pose is measured after."""
    X_WE = X_WT @ Pose.of([0, 0, -(FLANGE_OFFSET + world.config.tool.length)])
    for _ in range(3):
        q = world.client.calculateInverseKinematics(
            world.arm,
            world.flange,
            X_WE.position,
            X_WE.quaternion,
            maxNumIterations=60,
            residualThreshold=1e-4,
        )
        world.set_arm(q[:7])


def _any_rotation(rng: np.random.Generator) -> Array:
    return rotation_from_quaternion(rng.normal(size=4))


def _overlaps(bin: BinConfig, low: Array, high: Array) -> bool:
    half = np.array(bin.size[:2]) / 2
    centre = np.array(bin.position[:2])
    return bool((centre + half > low + 0.04).all() and (centre - half < high - 0.04).all())


def _inside(bin: BinConfig, point: Array, margin: float) -> bool:
    return bool((np.abs(point - bin.position[:2]) < np.array(bin.size[:2]) / 2 + margin).all())


def _heap(
    labels: list[str], low: Array, high: Array, bins: list[BinConfig], rng: np.random.Generator
) -> list[Pose]:
    """Return starting poses one above the other, over a point of the table or over a bin."""
    if bins and rng.random() < 0.6:
        centre = np.array(bins[int(rng.integers(len(bins)))].position[:2])
    else:
        centre = rng.uniform(low + 0.03, np.maximum(high - 0.03, low + 0.031))
    spread = rng.uniform(0.01, 0.06)
    return [
        Pose(_any_rotation(rng), np.array([*(centre + rng.normal(0, spread, 2)), 0.05 + 0.055 * i]))
        for i in range(len(labels))
    ]


def _spread(
    config: CellConfig,
    meshes: Mapping[str, Mesh],
    labels: list[str],
    low: Array,
    high: Array,
    bins: list[BinConfig],
    rng: np.random.Generator,
) -> tuple[list[str], list[Pose]]:
    """Return those objects that find a place side by side, standing on the table or in a bin."""
    gap = rng.uniform(0.001, 0.02)
    chosen: list[str] = []
    poses: list[Pose] = []
    for label in labels:
        radius = config.objects[label].radius
        for _ in range(30):
            point, floor = rng.uniform(low, high), 0.0
            if bins and rng.random() < 0.35:
                bin = bins[int(rng.integers(len(bins)))]
                half = np.array(bin.size[:2]) / 2 - radius
                point = np.array(bin.position[:2]) + rng.uniform(-half, half)
            inside = [bin for bin in config.bins.values() if _inside(bin, point, -radius)]
            if inside:
                floor = inside[0].position[2] + BIN_THICKNESS
            elif any(_inside(bin, point, radius + BIN_THICKNESS) for bin in config.bins.values()):
                continue
            others = zip(chosen, poses, strict=True)
            free = all(
                np.linalg.norm(pose.position[:2] - point) > radius + config.objects[other].radius + gap
                for other, pose in others
            )
            if free and np.linalg.norm(point) > FOOT:
                turn = about_z(rng.uniform(0, math.tau))
                chosen.append(label)
                poses.append(Pose(turn, np.array([*point, floor - meshes[label].bottom])))
                break
    return chosen, poses
