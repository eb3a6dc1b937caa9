"""Initial world of a run: random objects at rest on the table of a scene."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from executive.cell.config import CellConfig, ObjectConfig
from executive.cell.devices import derive_seeds
from executive.cell.objects import UNKNOWN_LABEL
from executive.drivers.sim.models import (
    DAMAGED_MODEL_NUMBER,
    DROP_HEIGHT,
    load_mesh,
    load_unknown_model,
    name_unknown_model,
    scale_model,
)
from executive.drivers.sim.scene import DECLARED_SCENE, SceneConfig, UnknownConfig, build_world, load_scene
from executive.drivers.sim.world import World
from executive.errors import InputError
from executive.geometry import Array, Pose, rotate_about_z
from executive.text.validate import KeyPath

MAX_STACK_OFFSET = 0.004
"""Maximum offset between the axes of two stacked objects, along x and y [m]."""
PUSH_SPEED = 0.1
"""Horizontal speed given to an upper object to test a stack [m/s]; a stable object stops within 1 mm."""


def build_initial_world(
    config: CellConfig, seed: int, *, gui: bool = False, scene: SceneConfig = DECLARED_SCENE
) -> World:
    """Return the initial world of the run with a seed: arm at `home`, objects at rest on the table.

    Raises:
        InputError: The workspace has no room for the objects.
    """
    world = build_world(config, scene, gui=gui)
    object_seed, *_ = derive_seeds(seed)
    spawn_objects(world, object_seed, scene.unknown)
    world.rest_positions = {body: [world.get_object_pose(body).position] for body in world.labels}
    return world


def build_world_of_run(
    config: CellConfig, seed: int, driver_options: Mapping[str, str]
) -> tuple[World, SceneConfig]:
    """Return the initial world of a run, and its scene.

    The options are `scene`, the path of a scene file, and `gui`, which shows the world in a window.

    Raises:
        MissionError: The scene file is invalid; the error lists all findings.
        InputError: The workspace has no room for the objects, or there is no scene file.
    """
    scene = load_scene(driver_options.get("scene"), config)
    return build_initial_world(config, seed, gui="gui" in driver_options, scene=scene), scene


def spawn_objects(world: World, seed: int, unknown: UnknownConfig | None = None) -> tuple[int, ...]:
    """Put random objects on the table, simulate until they are at rest, and return the bodies.

    The cell file of the world states the classes and the range of their number.

    Raises:
        InputError: The workspace has no room for the objects.
    """
    config = world.config
    rng = np.random.default_rng(seed)
    count = int(rng.integers(*config.table.objects, endpoint=True))
    labels = [str(label) for label in rng.choice(list(config.objects), count)]
    models = [(label, config.objects[label].draw_model(rng)) for label in labels]
    if unknown is not None:
        models += [(UNKNOWN_LABEL, model) for model in _draw_unknown_models(unknown, rng)]
    positions = draw_positions(config, [model.radius for _, model in models], rng)
    bodies = []
    for (label, model), position in zip(models, positions, strict=True):
        height = DROP_HEIGHT - load_mesh(model).bottom
        X_WO = Pose(rotate_about_z(rng.uniform(0, math.tau)), np.array([*position, height]))
        colour = model.colours[int(rng.integers(len(model.colours)))]
        bodies.append(world.add_object(label, X_WO, colour, model))
    world.settle(bodies)
    if config.table.stacked:
        _stack_objects(world, bodies[:count], config.table.stacked, rng)
    return tuple(bodies)


def _draw_unknown_models(unknown: UnknownConfig, rng: np.random.Generator) -> Iterator[ObjectConfig]:
    first_number, last_number = unknown.models
    shapes = unknown.meshes or [
        name_unknown_model(number)
        for number in range(first_number, last_number + 1)
        if number != DAMAGED_MODEL_NUMBER
    ]
    count = int(rng.integers(*unknown.count, endpoint=True))
    for index in rng.choice(len(shapes), count):
        model = scale_model(load_unknown_model(shapes[index]), unknown.scale)
        yield model.model_copy(update={"colours": unknown.colours})


def _stack_objects(world: World, bodies: Sequence[int], probability: float, rng: np.random.Generator) -> None:
    """Put objects at rest, each with a probability of 0 to 1, on others, in stacks of two.

    A simulation tests each stack, first without and then with a push. If the upper object falls, all objects
    return to their previous poses. Balls are therefore never stacked.
    """
    unstacked = set(bodies)
    for upper in bodies:
        if rng.random() >= probability or upper not in unstacked:
            continue
        for lower in map(int, rng.permutation(sorted(unstacked - {upper}))):
            if _try_stack(world, upper, lower, rng):
                unstacked -= {upper, lower}
                break


def _try_stack(world: World, upper: int, lower: int, rng: np.random.Generator) -> bool:
    """Put one object on another and return True if the stack is stable; otherwise restore all poses."""
    initial_poses = {body: world.get_object_pose(body) for body in world.labels}
    lower_position = initial_poses[lower].position
    lower_mesh, upper_mesh = (load_mesh(world.models[body]) for body in (lower, upper))
    height = lower_position[2] + lower_mesh.top - upper_mesh.bottom + DROP_HEIGHT
    offset = rng.uniform(-MAX_STACK_OFFSET, MAX_STACK_OFFSET, 2)
    position = np.array([*(lower_position[:2] + offset), height])
    goals = {**initial_poses, upper: Pose(rotate_about_z(rng.uniform(0, math.tau)), position)}
    world.place_object(upper, goals[upper])
    world.settle(goals, goals)
    angle = rng.uniform(0, math.tau)
    world.client.resetBaseVelocity(upper, [PUSH_SPEED * math.cos(angle), PUSH_SPEED * math.sin(angle), 0.0])
    world.settle(goals, goals)
    if not world.has_moved(goals):
        return True
    for body, X_WO in initial_poses.items():
        world.place_object(body, X_WO)
    return False


MAX_POSITION_ATTEMPTS = 2000
"""Number of random positions for one set of objects after which the workspace counts as too small."""
OBJECT_SET_COUNT = 5
"""Number of random sets of objects for which `find_object_count_errors` tries to find positions."""


def find_object_count_errors(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield the key and an error if no random set with the maximum number of objects fits the workspace."""
    message = ""
    for seed in range(OBJECT_SET_COUNT):
        rng = np.random.default_rng(seed)
        labels = [str(label) for label in rng.choice(list(config.objects), config.table.objects[1])]
        try:
            draw_positions(config, [config.objects[label].radius for label in labels], rng)
            return
        except InputError as error:
            message = str(error)
    yield ("table", "objects"), message


def find_max_object_count(config: CellConfig, limit: int) -> int:
    """Return the maximum number of objects, up to `limit`, for which the workspace has room."""
    for count in range(limit, 0, -1):
        table = config.table.model_copy(update={"objects": (0, count)})
        if not any(find_object_count_errors(config.model_copy(update={"table": table}))):
            return count
    return 0


def draw_positions(config: CellConfig, radii: Sequence[float], rng: np.random.Generator) -> list[Array]:
    """Return random positions `(2,)` [m] of circles with the given radii [m] and the gap of the cell file.

    After a failed attempt to position a circle, all circles are positioned again with a probability of 2 %.

    Raises:
        InputError: The workspace has no room for the circles.
    """
    low, high = np.array([config.table.x, config.table.y]).T
    positions: list[Array] = []
    for _ in range(MAX_POSITION_ATTEMPTS):
        if len(positions) == len(radii):
            return positions
        position = rng.uniform(low, high)
        radius = radii[len(positions)]
        circles = zip(positions, radii, strict=False)
        gaps = [np.linalg.norm(position - centre) - radius - other_radius for centre, other_radius in circles]
        if min(gaps, default=math.inf) >= config.table.gap:
            positions.append(position)
        elif rng.random() < 0.02:
            positions = []
    raise InputError(
        f"{len(radii)} objects found no room on the workspace of cell {config.cell}, "
        f"{high[0] - low[0]:.2f} m by {high[1] - low[1]:.2f} m, {config.table.gap * 1000:.0f} mm apart; "
        "ask for fewer or widen table.x and table.y"
    )
