"""Initial world of a run: random seeds, and random objects at rest, some of them stacked."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.workcell import KeyPath
from executive.cells.audit import UNKNOWN
from executive.cells.sim.models import load_mesh
from executive.cells.sim.scene_file import DECLARED_SCENE, SceneConfig, UnknownConfig
from executive.cells.sim.scene_world import paint_table, true_cell, unknown_objects
from executive.cells.sim.world import World
from executive.errors import InputError
from executive.geometry import Array, Pose, rotate_about_z

MAX_PLACE_ATTEMPTS = 2000
"""Maximum number of places tried for one set of objects; then the workspace counts as too small."""
LAYOUT_COUNT = 5
"""Number of random sets of objects tried before `find_lack_of_room` reports a lack of room."""
DROP_HEIGHT = 0.002
"""Height above its support at which an object is released [m]."""
MAX_REST_SPEED = 0.002
"""Speed below which an object counts as at rest [m/s]."""
MIN_SETTLING_STEPS, MAX_SETTLING_STEPS = 60, 480
"""Smallest and largest number of physics steps for settling; in the first steps objects are slow."""
MAX_STACK_OFFSET = 0.004
"""Largest offset between the axes of two stacked objects, along x and y [m]."""
NUDGE_SPEED = 0.1
"""Speed of the sideways push that tests a stack [m/s]; friction stops a stable object within 1 mm."""
MAX_SHIFT = 0.005
"""Distance beyond which an object counts as moved [m]."""


@dataclass(frozen=True)
class PartSeeds:
    """Random seeds of the parts of a simulated cell.

    Attributes:
        objects: Seed of the objects and their poses.
        camera: Seed of the noise of the camera.
        detectors: Seed of the random numbers of detectors.
    """

    objects: int
    camera: int
    detectors: int

    @staticmethod
    def of(seed: int) -> PartSeeds:
        """Return the seeds of the parts for the seed of a run."""
        parts = np.random.SeedSequence(seed).spawn(3)
        return PartSeeds(*(int(part.generate_state(1)[0]) for part in parts))


def build_initial_world(
    config: CellConfig, seed: int, *, gui: bool = False, scene: SceneConfig = DECLARED_SCENE
) -> World:
    """Return the initial world of a run with this seed: arm at `home`, objects at rest on the table.

    The attribute `config` of the world is the cell with the changes of the scene.

    Raises:
        InputError: The workspace has no room for the objects.
    """
    world = World(true_cell(config, scene), gui=gui)
    paint_table(world, scene)
    spawn(world, world.config, PartSeeds.of(seed).objects, unknown=scene.unknown)
    world.rest_positions.clear()
    return world


def spawn(
    world: World,
    config: CellConfig,
    seed: int,
    count: int | None = None,
    unknown: UnknownConfig | None = None,
) -> tuple[int, ...]:
    """Put objects on the table, step until they are at rest, and return the bodies.

    Args:
        world: The world of the objects.
        config: The cell file.
        seed: Seed of all random choices.
        count: Number of objects; None: random, in the range of the cell file.
        unknown: Additional objects without a class; None: none.

    Raises:
        InputError: The workspace has no room for the objects.
    """
    rng = np.random.default_rng(seed)
    table = config.table
    if count is None:
        count = int(rng.integers(table.objects[0], table.objects[1], endpoint=True))
    labels = [str(label) for label in rng.choice(list(config.objects), count)]
    kinds = [(label, config.objects[label]) for label in labels]
    kinds += [(UNKNOWN, model) for model in unknown_objects(unknown, rng)]
    places = _places(config, [model.radius for _, model in kinds], rng)
    bodies = []
    for (label, model), place in zip(kinds, places, strict=True):
        height = DROP_HEIGHT - load_mesh(model).bottom
        X_WO = Pose(rotate_about_z(rng.uniform(0, math.tau)), np.array([*place, height]))
        colour = model.colours[int(rng.integers(len(model.colours)))]
        bodies.append(world.add_object(label, X_WO, colour, model))
    _come_to_rest(world, bodies)
    if table.stacked:
        _stack(world, bodies[:count], table.stacked, rng)
    return tuple(bodies)


def find_lack_of_room(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield a finding if none of `LAYOUT_COUNT` random sets of the maximum size fits the workspace."""
    problem = ""
    for seed in range(LAYOUT_COUNT):
        rng = np.random.default_rng(seed)
        labels = [str(label) for label in rng.choice(list(config.objects), config.table.objects[1])]
        try:
            _places(config, [config.objects[label].radius for label in labels], rng)
        except InputError as error:
            problem = str(error)
        else:
            return
    yield ("table", "objects"), problem


def find_max_count(config: CellConfig, most: int) -> int:
    """Return the largest number of objects, up to `most`, for which the workspace has room."""
    for count in range(most, 0, -1):
        table = config.table.model_copy(update={"objects": (0, count)})
        if not any(find_lack_of_room(config.model_copy(update={"table": table}))):
            return count
    return 0


def _places(config: CellConfig, radii: Sequence[float], rng: np.random.Generator) -> list[Array]:
    """Return random places `(2,)` [m] for outlines of these radii [m], with the gap between them.

    All places are drawn again if an outline finds no place.
    """
    low, high = np.array([config.table.x, config.table.y]).T
    places: list[Array] = []
    for _ in range(MAX_PLACE_ATTEMPTS):
        if len(places) == len(radii):
            return places
        place, radius = rng.uniform(low, high), radii[len(places)]
        gaps = [np.linalg.norm(place - p) - radius - r for p, r in zip(places, radii, strict=False)]
        if min(gaps, default=math.inf) >= config.table.gap:
            places.append(place)
        elif rng.random() < 0.02:
            places = []
    raise InputError(
        f"{len(radii)} objects found no room on the workspace of cell {config.cell}, "
        f"{high[0] - low[0]:.2f} m by {high[1] - low[1]:.2f} m, {config.table.gap * 1000:.0f} mm apart; "
        "ask for fewer or widen table.x and table.y"
    )


def _stack(world: World, bodies: Sequence[int], share: float, rng: np.random.Generator) -> None:
    """Put each object on another one with probability `share`, if another one can carry it.

    A simulation tests each stack: if the upper object falls, with or without a push, all objects return to
    their poses. Balls are therefore never stacked. A stack has two objects.

    Args:
        world: The world with the objects at rest.
        bodies: The objects.
        share: Probability, 0 to 1.
        rng: Random number generator.
    """
    free = set(bodies)
    for upper in bodies:
        if rng.random() >= share or upper not in free:
            continue
        for lower in map(int, rng.permutation(sorted(free - {upper}))):
            if _put_on(world, upper, lower, rng):
                free -= {upper, lower}
                break


def _put_on(world: World, upper: int, lower: int, rng: np.random.Generator) -> bool:
    """Put one object on another, and return True if it stays; otherwise restore all poses."""
    before = {body: world.get_object_pose(body) for body in world.bodies}
    base = before[lower].position
    below, above = (load_mesh(world.models[body]) for body in (lower, upper))
    height = base[2] + below.top - above.bottom + DROP_HEIGHT
    place = np.array([*(base[:2] + rng.uniform(-MAX_STACK_OFFSET, MAX_STACK_OFFSET, 2)), height])
    goal = {**before, upper: Pose(rotate_about_z(rng.uniform(0, math.tau)), place)}
    world.place_object(upper, goal[upper])
    _come_to_rest(world, list(goal), lambda: _has_moved(world, goal))
    heading = rng.uniform(0, math.tau)
    world.client.resetBaseVelocity(
        upper, [NUDGE_SPEED * math.cos(heading), NUDGE_SPEED * math.sin(heading), 0.0]
    )
    _come_to_rest(world, list(goal), lambda: _has_moved(world, goal))
    if not _has_moved(world, goal):
        return True
    for body, X_WO in before.items():
        world.place_object(body, X_WO)
    return False


def _has_moved(world: World, goal: Mapping[int, Pose]) -> bool:
    """Return True if any body is farther than `MAX_SHIFT` from its goal."""
    return any(
        float(np.linalg.norm(world.get_object_pose(body).position - X_WO.position)) > MAX_SHIFT
        for body, X_WO in goal.items()
    )


def _come_to_rest(world: World, bodies: Sequence[int], is_done: Callable[[], bool] = lambda: False) -> None:
    """Step until all bodies are at rest or `is_done` returns True, at most for `MAX_SETTLING_STEPS`."""
    for step in range(MAX_SETTLING_STEPS):
        world.step()
        speeds = [np.linalg.norm(world.client.getBaseVelocity(body)[0]) for body in bodies]
        if (step >= MIN_SETTLING_STEPS and max(speeds, default=0.0) < MAX_REST_SPEED) or is_done():
            return
