"""Random arm pose, objects, light, table, camera and noise of a labelled scene (domain randomization).

The ranges are larger than the variation in scenes of missions.
"""

from __future__ import annotations

import colorsys
import contextlib
import math
from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.random import Generator

from executive.cell.arm import Goal
from executive.cell.config import CellConfig, ObjectConfig
from executive.cell.device_config import CameraConfig, Colour, NoiseConfig, Range
from executive.cell.devices import TrueObject
from executive.cell.objects import BIN_THICKNESS, UNKNOWN_LABEL, Bin
from executive.drivers.sim.camera import Light, Region
from executive.drivers.sim.models import (
    DAMAGED_MODEL_NUMBER,
    SETTLING_STEP_COUNT,
    add_body,
    build_drop_world,
    has_texture,
    load_mesh,
    load_unknown_model,
    locate_object,
    name_unknown_model,
    scale_model,
)
from executive.drivers.sim.world import PLAIN_TEXTURE, TEXTURES, WOOD_TEXTURE, World
from executive.errors import Unreachable
from executive.geometry import Array, Pose, rotate_about_z
from executive.motion.configurations import find_configuration_pairs
from executive.motion.joints import Kinematics
from executive.perception.camera_model import intersect_plane
from executive.physics.cell_world import add_bin

MAX_FOV_CHANGE = 0.27
"""Maximum relative change of the field of view."""
MAX_DISTANCE_CHANGE = 0.27
"""Maximum relative change of the distance of a fixed camera from the centre of its view on the table."""
MAX_SHIFT = 0.06
"""Maximum shift of a fixed camera along x and y [m]."""
MAX_TILT = math.radians(16)
"""Maximum tilt of a fixed camera about the centre of its view on the table [rad]."""
WOOD_COLOUR = (0.87, 0.78, 0.65)
"""Mean colour of the wood texture of the table: red, green and blue, each 0 to 1."""


def draw_light(rng: np.random.Generator) -> Light:
    """Return the light of the cell (probability 0.2), or a light with normal, low or high brightness."""
    shadow = bool(rng.random() < 0.35)
    if rng.random() < 0.2:
        return Light(shadow=shadow)
    azimuth = rng.uniform(0, math.tau)
    elevation = rng.uniform(math.radians(18), math.pi / 2)
    x = math.cos(elevation) * math.cos(azimuth)
    y = math.cos(elevation) * math.sin(azimuth)
    red, green, blue = rng.uniform(0.72, 1.0, 3)
    random_number = rng.random()
    brightness = 1.0 if random_number < 0.5 else 1.5
    if 0.5 <= random_number < 0.8:
        brightness = math.exp(rng.uniform(math.log(0.12), 0.0))
    return Light(
        direction=(x, y, math.sin(elevation)),
        colour=(red, green, blue),
        ambient=brightness * rng.uniform(0.40, 0.70),
        diffuse=brightness * rng.uniform(0.20, 0.60),
        specular=rng.uniform(0.0, 0.8) if random_number >= 0.8 else brightness * rng.uniform(0.0, 0.30),
        shadow=shadow,
    )


def draw_table_appearance(rng: np.random.Generator) -> tuple[Colour, str]:
    """Return colour and texture of the table: unchanged in 30 % of the scenes, slightly tinted in 20 %.

    In the other scenes the table has a random colour, and a wood texture, no texture or a random texture.
    """
    random_number = rng.random()
    if random_number < 0.3:
        return (1.0, 1.0, 1.0), WOOD_TEXTURE
    if random_number < 0.5:
        red, green, blue = rng.uniform(0.75, 1.0) * rng.uniform(0.88, 1.0, 3)
        return (red, green, blue), WOOD_TEXTURE
    texture = WOOD_TEXTURE if random_number < 0.6 else PLAIN_TEXTURE
    if random_number >= 0.75:
        texture = str(rng.choice(TEXTURES))
    return draw_hsv_colour(rng, (0.0, 0.8), (0.10, 1.0)), texture


def draw_object_colour(palette: Sequence[Colour], table_colour: Colour, rng: np.random.Generator) -> Colour:
    """Return a random object colour: of the class, of any hue, grey, nearly black, or similar to the table.

    Args:
        palette: Colours of the class of the object.
        table_colour: Mean colour of the table.
        rng: Random number generator.
    """
    random_number = rng.random()
    if random_number < 0.35:
        return palette[int(rng.integers(len(palette)))]
    if random_number < 0.65:
        return draw_hsv_colour(rng, (0.3, 1.0), (0.25, 1.0))
    if random_number < 0.78:
        grey = rng.uniform(0.05, 1.0)
        return grey, grey, grey
    if random_number < 0.93:
        return draw_hsv_colour(rng, (0.0, 0.6), (0.02, 0.16))
    red, green, blue = np.clip(table_colour + rng.normal(0, 0.12, 3), 0.02, 1.0)
    return float(red), float(green), float(blue)


def draw_colour(model: ObjectConfig, table_colour: Colour, rng: Generator) -> Colour:
    """Return a random colour of a model, or a random factor of the colours of its texture."""
    return draw_tint(rng) if has_texture(model) else draw_object_colour(model.colours, table_colour, rng)


def draw_tint(rng: np.random.Generator) -> Colour:
    """Return a random factor of the colours of a texture, which keeps them recognizable."""
    red, green, blue = rng.uniform(0.65, 1.0) * rng.uniform(0.85, 1.0, 3)
    return red, green, blue


def draw_hsv_colour(rng: np.random.Generator, saturations: Range, values: Range) -> Colour:
    """Return a colour with random hue, and with saturation and value in the given ranges, each 0 to 1."""
    return colorsys.hsv_to_rgb(rng.random(), rng.uniform(*saturations), rng.uniform(*values))


def draw_camera(
    camera: CameraConfig, matrix: Array, X_WC: Pose, rng: np.random.Generator
) -> tuple[Array, Pose]:
    """Return camera matrix and pose of a camera: as declared in 40 % of the scenes, otherwise random.

    The pose of a camera on the wrist is not changed, because the pose of the arm already varies.

    Args:
        camera: Section of the camera in the cell file.
        matrix: Declared camera matrix `(3, 3)` [pixel].
        X_WC: Declared pose of the camera.
        rng: Random number generator.
    """
    if rng.random() < 0.4:
        return matrix, X_WC
    centre = np.array([camera.width - 1, camera.height - 1]) / 2
    half_fov = math.atan(camera.height / 2 / matrix[1, 1])
    focal_factor = math.tan(half_fov) / math.tan(half_fov * (1 + rng.uniform(-1, 1) * MAX_FOV_CHANGE))
    matrix = np.diag([focal_factor, focal_factor, 1.0]) @ matrix
    matrix[:2, 2] = centre
    if camera.mount == "wrist":
        return matrix, X_WC
    target = intersect_plane(matrix, X_WC, (centre[0], centre[1]), 0.0)
    angle = rng.uniform(0, math.tau)
    tilt = MAX_TILT * float(rng.choice([0.0, 0.1, 0.3, 1.0])) * rng.random()
    rotation, _ = cv2.Rodrigues(tilt * np.array([math.cos(angle), math.sin(angle), 0.0]))
    rotation = np.asarray(rotation) @ rotate_about_z(rng.normal(0, math.radians(3)))
    offset = (X_WC.position - target) * (1 + rng.uniform(-1, 1) * MAX_DISTANCE_CHANGE)
    shift = np.array([*rng.uniform(-MAX_SHIFT, MAX_SHIFT, 2), 0.0])
    return matrix, Pose(rotation @ X_WC.rotation, target + rotation @ offset + shift)


def draw_noise(noise: NoiseConfig, rng: np.random.Generator) -> NoiseConfig:
    """Return the noise of a camera: as declared in 60 % of the scenes, otherwise random.

    Random gain noise exceeds the declared noise; random read noise is 0.37 to 9 times the declared noise.
    """
    if rng.random() < 0.6:
        return noise
    gain = noise.gain + rng.exponential(0.06)
    return NoiseConfig(gain=gain, read=noise.read * math.exp(rng.uniform(-1, 2.2)))


MAX_SPARSE_OBJECT_COUNT = 7
"""Maximum number of objects in a sparse scene."""
MAX_DENSE_OBJECT_COUNT = 20
"""Maximum number of objects in a dense scene."""
SCALE_FACTORS = (0.75, 0.8, 0.85, 0.9, 0.95, 1.05, 1.1, 1.15, 1.2, 1.3)
"""Scale factors of objects whose size differs from the size of their class."""
TRAINING_MODEL_NUMBERS = tuple(number for number in range(800) if number != DAMAGED_MODEL_NUMBER)
"""Indices of the shapes for unknown objects in training; all other shapes are reserved for tests."""
OWN_UNKNOWN_FRACTION = 0.8
"""Fraction of the unknown objects that have meshes of the cell, if it has any."""
TABLE_X_RANGE = (-0.05, 0.86)
"""Range of the x coordinates of objects on the table top [m]."""
TABLE_Y_RANGE = (-0.71, 0.71)
"""Range of the y coordinates of objects on the table top [m]."""
MIN_BASE_DISTANCE = 0.16
"""Minimum distance of an object from the axis of the base of the arm [m]."""
MAX_POSE_ATTEMPTS = 20
"""Maximum number of random places of the tool until the arm can reach one."""


def move_arm_randomly(world: World, kinematics: Kinematics, camera: CameraConfig, rng: Generator) -> bool:
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
        q = world.get_joint_positions()
        with contextlib.suppress(Unreachable):
            X_WT = Pose(rotation, X_WT.position + offset) @ tilt
            (q,) = kinematics.solve([X_WT], kinematics.find_branch(q))
        if kinematics.joint_range.contains(q):
            world.set_joint_positions(q)
        return bool(rng.random() < 0.08)
    if is_near_scan_pose:
        return False
    for _ in range(MAX_POSE_ATTEMPTS):
        x, y, z = rng.uniform((0.25, -0.50, 0.05), (0.72, 0.50, 0.40)).tolist()
        goal = Goal((x, y, z), yaws=(math.atan2(y, x) + rng.uniform(-1.2, 1.2),))
        with contextlib.suppress(Unreachable):
            qs = find_configuration_pairs(kinematics, goal, 0.0, world.get_joint_positions()).lower_qs
            world.set_joint_positions(qs[int(rng.integers(len(qs)))])
            break
    return bool(rng.random() < 0.3)


def draw_region(camera: CameraConfig, rng: Generator) -> Region:
    """Return the image region of a scene: mostly `table_view`, else a random region of equal size."""
    left, top, right, bottom = camera.table_view
    if rng.random() < 0.65:
        return camera.table_view
    x = int(rng.integers(0, camera.width - (right - left), endpoint=True))
    y = int(rng.integers(0, camera.height - (bottom - top), endpoint=True))
    return x, y, x + right - left, y + bottom - top


def draw_objects(config: CellConfig, count: int, table_colour: Colour, rng: Generator) -> list[TrueObject]:
    """Return `count` random objects at the origin; some scenes contain unknown or scaled objects."""
    unknown_fraction = rng.uniform(0.05, 0.4) if rng.random() < 0.35 else 0.0
    scaled_fraction = rng.uniform(0.2, 1.0) if rng.random() < 0.35 else 0.0
    objects = []
    for name in map(str, rng.choice(list(config.objects), count)):
        label = name
        model = config.objects[name].draw_model(rng)
        colour = draw_colour(model, table_colour, rng)
        if rng.random() < unknown_fraction:
            label = UNKNOWN_LABEL
            if config.unknown.meshes and rng.random() < OWN_UNKNOWN_FRACTION:
                model = load_unknown_model(str(rng.choice(config.unknown.meshes)))
            else:
                model = load_unknown_model(name_unknown_model(int(rng.choice(TRAINING_MODEL_NUMBERS))))
                model = scale_model(model, rng.uniform(0.4, 1.0))
            if has_texture(model) != has_texture(config.objects[name]):
                colour = draw_colour(model, table_colour, rng)
        elif rng.random() < scaled_fraction:
            model = scale_model(model, float(rng.choice(SCALE_FACTORS)))
        objects.append(TrueObject(label, Pose.identity(), model=model, colour=colour))
    return objects


def get_model(scene_object: TrueObject) -> ObjectConfig:
    """Return the model of an object of a rendered scene."""
    assert scene_object.model is not None
    return scene_object.model


def draw_arrangement(
    config: CellConfig, footprint: Array, shows_workspace: bool, table_colour: Colour, rng: Generator
) -> list[TrueObject]:
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
    all_bins = list(config.build_bins().values())
    bins = [bin for bin in all_bins if _overlaps_rectangle(bin, low, high)]
    random_number = rng.random()
    if random_number < 0.15:
        return simulate_fall(config, _draw_heap(objects[:MAX_SPARSE_OBJECT_COUNT], low, high, bins, rng))
    base = np.array(config.arm.base.position[:2])
    objects = _place_side_by_side(objects, low, high, bins, all_bins, base, rng)
    if random_number < 0.23:
        drop_offset = np.array([0, 0, 0.04])
        raised = [replace(o, X_WO=Pose(_draw_rotation(rng), o.position + drop_offset)) for o in objects]
        return simulate_fall(config, raised)
    if random_number < 0.40:
        _stack_randomly(objects, rng)
    return objects


def draw_held_object(X_WT: Pose, config: CellConfig, rng: Generator) -> TrueObject:
    """Return a random object that hangs upright at the tip of the tool."""
    (held_object,) = draw_objects(config, 1, (0.5, 0.5, 0.5), rng)
    position = X_WT.position - [0, 0, load_mesh(get_model(held_object)).top]
    return replace(held_object, X_WO=Pose(rotate_about_z(rng.uniform(0, math.tau)), position))


def simulate_fall(config: CellConfig, objects: Sequence[TrueObject]) -> list[TrueObject]:
    """Simulate the fall of objects onto table and bins for 1.5 s, and return the objects at the final poses.

    Each call uses a new physics world, so that the result depends only on the initial poses.
    """
    client = build_drop_world()
    try:
        for bin in config.bins.values():
            add_bin(client, bin)
        bodies = [add_body(client, get_model(scene_object), scene_object.X_WO) for scene_object in objects]
        for _ in range(SETTLING_STEP_COUNT):
            client.stepSimulation()
        pairs = zip(bodies, objects, strict=True)
        return [replace(item, X_WO=locate_object(client, body, get_model(item))) for body, item in pairs]
    finally:
        client.disconnect()


def _draw_rotation(rng: Generator) -> Array:
    return Pose.of(np.zeros(3), rng.normal(size=4)).rotation


def _overlaps_rectangle(bin: Bin, low: Array, high: Array) -> bool:
    """Return True if a bin overlaps the rectangle from `low` to `high` `(2,)` [m] by over 4 cm."""
    centre = bin.position[:2]
    half_size = bin.size[:2] / 2
    return bool((centre + half_size > low + 0.04).all() and (centre - half_size < high - 0.04).all())


def _draw_heap(
    objects: Sequence[TrueObject], low: Array, high: Array, bins: list[Bin], rng: Generator
) -> list[TrueObject]:
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


def _stack_randomly(objects: list[TrueObject], rng: Generator) -> None:
    """Put some objects nearly centred on others; the stability of the stacks is not simulated."""
    for _ in range(int(rng.integers(1, 1 + max(1, len(objects) // 3)))):
        if len(objects) < 2:
            return
        upper, lower = (int(index) for index in rng.choice(len(objects), 2, replace=False))
        lower_object = objects[lower]
        point = lower_object.position[:2]
        distances = [math.dist(item.position[:2], point) for item in objects if item is not lower_object]
        if min(distances) < 0.01:
            continue
        height = load_mesh(get_model(lower_object)).top - load_mesh(get_model(objects[upper])).bottom
        position = lower_object.position + np.array([*rng.normal(0, 0.003, 2), height])
        X_WO = Pose(rotate_about_z(rng.uniform(0, math.tau)), position)
        objects[upper] = replace(objects[upper], X_WO=X_WO)


def _place_side_by_side(
    objects: list[TrueObject],
    low: Array,
    high: Array,
    bins: list[Bin],
    all_bins: list[Bin],
    base: Array,
    rng: Generator,
) -> list[TrueObject]:
    """Return objects at random free positions on the table or in `bins`; objects without room are omitted."""
    gap = rng.uniform(0.0, 0.02)
    placed_objects: list[TrueObject] = []
    for candidate in objects:
        radius = get_model(candidate).radius
        for _ in range(30):
            point = rng.uniform(low, high)
            floor_height = 0.0
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
                np.linalg.norm(item.position[:2] - point) > radius + get_model(item).radius + gap
                for item in placed_objects
            )
            if is_free and np.linalg.norm(point - base) > MIN_BASE_DISTANCE:
                position = np.array([*point, floor_height - load_mesh(get_model(candidate)).bottom])
                X_WO = Pose(rotate_about_z(rng.uniform(0, math.tau)), position)
                placed_objects.append(replace(candidate, X_WO=X_WO))
                break
    return placed_objects
