"""Initial world of a run: random objects at rest, some in stacks; and random seeds of a run."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.objects import UNKNOWN_LABEL
from executive.cell.workcell import KeyPath
from executive.cells.sim.models import load_mesh
from executive.cells.sim.scene_file import (
    DECLARED_SCENE,
    SceneConfig,
    UnknownConfig,
    build_world,
    draw_unknown_models,
)
from executive.cells.sim.world import World
from executive.errors import InputError
from executive.geometry import Array, Pose, rotate_about_z

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
        position, radius = rng.uniform(low, high), radii[len(positions)]
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


DROP_HEIGHT = 0.002
"""Height above its support at which an object is released [m]."""
MAX_REST_SPEED = 0.002
"""Speed below which an object counts as at rest [m/s]."""
MIN_SETTLING_STEPS, MAX_SETTLING_STEPS = 60, 480
"""Minimum and maximum number of physics steps until rest; released objects are slow in the first steps."""
MAX_STACK_OFFSET = 0.004
"""Maximum offset between the axes of two stacked objects, along x and y [m]."""
PUSH_SPEED = 0.1
"""Horizontal speed given to an upper object to test a stack [m/s]; a stable object stops within 1 mm."""
MAX_DISPLACEMENT = 0.005
"""Maximum distance of an object in a stable stack from its goal position [m]."""


def derive_seeds(seed: int) -> tuple[int, ...]:
    """Return the random seeds of objects, camera noise, detectors and load noise for the seed of a run."""
    return tuple(int(child.generate_state(1)[0]) for child in np.random.SeedSequence(seed).spawn(4))


def build_initial_world(
    config: CellConfig, seed: int, *, gui: bool = False, scene: SceneConfig = DECLARED_SCENE
) -> World:
    """Return the initial world of the run with a seed: arm at `home`, objects at rest on the table.

    The attribute `config` of the world is the cell file with the changes of the scene.

    Raises:
        InputError: The workspace has no room for the objects.
    """
    world = build_world(config, scene, gui=gui)
    object_seed, *_ = derive_seeds(seed)
    spawn_objects(world, object_seed, scene.unknown)
    world.rest_positions = {body: [world.get_object_pose(body).position] for body in world.labels}
    return world


def spawn_objects(world: World, seed: int, unknown: UnknownConfig | None = None) -> tuple[int, ...]:
    """Put random objects on the table, simulate until they are at rest, and return the bodies.

    Args:
        world: The world of the objects, whose cell file states the classes and the range of their number.
        seed: Seed of all random choices.
        unknown: Section of additional objects without a class, or None.

    Raises:
        InputError: The workspace has no room for the objects.
    """
    rng = np.random.default_rng(seed)
    config, table = world.config, world.config.table
    count = int(rng.integers(*table.objects, endpoint=True))
    labels = [str(label) for label in rng.choice(list(config.objects), count)]
    models = [(label, config.objects[label]) for label in labels]
    models += [(UNKNOWN_LABEL, model) for model in draw_unknown_models(unknown, rng)]
    positions = draw_positions(config, [model.radius for _, model in models], rng)
    bodies = []
    for (label, model), position in zip(models, positions, strict=True):
        height = DROP_HEIGHT - load_mesh(model).bottom
        X_WO = Pose(rotate_about_z(rng.uniform(0, math.tau)), np.array([*position, height]))
        colour = model.colours[int(rng.integers(len(model.colours)))]
        bodies.append(world.add_object(label, X_WO, colour, model))
    _step_until_rest(world, bodies, lambda: False)
    if table.stacked:
        _stack_objects(world, bodies[:count], table.stacked, rng)
    return tuple(bodies)


def _stack_objects(world: World, bodies: Sequence[int], probability: float, rng: np.random.Generator) -> None:
    """Put random objects on others, in stacks of two.

    A simulation tests each stack, first without and then with a push. If the upper object falls, all objects
    return to their previous poses. Balls are therefore never stacked.

    Args:
        world: The world with the objects at rest.
        bodies: The objects.
        probability: Probability of a stack for each object, 0 to 1.
        rng: Random number generator.
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
    _step_until_rest(world, list(goals), lambda: _has_moved(world, goals))
    angle = rng.uniform(0, math.tau)
    world.client.resetBaseVelocity(upper, [PUSH_SPEED * math.cos(angle), PUSH_SPEED * math.sin(angle), 0.0])
    _step_until_rest(world, list(goals), lambda: _has_moved(world, goals))
    if not _has_moved(world, goals):
        return True
    for body, X_WO in initial_poses.items():
        world.place_object(body, X_WO)
    return False


def _has_moved(world: World, goals: Mapping[int, Pose]) -> bool:
    """Return True if any body is farther than `MAX_DISPLACEMENT` from its goal pose."""
    return any(
        float(np.linalg.norm(world.get_object_pose(body).position - X_WO.position)) > MAX_DISPLACEMENT
        for body, X_WO in goals.items()
    )


def _step_until_rest(world: World, bodies: Sequence[int], must_end: Callable[[], bool]) -> None:
    """Step until all bodies are at rest or `must_end` returns True, at most `MAX_SETTLING_STEPS` times."""
    for step in range(MAX_SETTLING_STEPS):
        world.step()
        speeds = [np.linalg.norm(world.client.getBaseVelocity(body)[0]) for body in bodies]
        if (step >= MIN_SETTLING_STEPS and max(speeds, default=0.0) < MAX_REST_SPEED) or must_end():
            return
