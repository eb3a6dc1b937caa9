"""PyBullet world of a cell: arm with tool, table, bins and loose objects, and their shapes for display.

The origin of the world frame W is on the table top. Worlds with equal cell files and
equal objects in equal order are bitwise identical.
"""

from __future__ import annotations

import tempfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pybullet
from numpy.typing import NDArray

from executive.cell.config import CellConfig, ObjectConfig
from executive.cell.device_config import Colour
from executive.cell.devices import Shape, TrueObject
from executive.drivers import world_log
from executive.drivers.sim.models import add_body, compute_upright_pose, get_inertial_pose, locate_object
from executive.drivers.world_log import CommandLog
from executive.geometry import Array, Pose
from executive.physics.cell_world import CellWorld

WOOD_TEXTURE = "wood"
"""Name of the texture in the URDF of the table."""
PLAIN_TEXTURE = "plain"
"""Name of the texture of a white surface."""
PATTERN_COUNT = 24
"""Number of generated textures, whose names are `pattern 0` to `pattern 23`."""
TEXTURES = (WOOD_TEXTURE, PLAIN_TEXTURE, *(f"pattern {number}" for number in range(PATTERN_COUNT)))
"""Names of all textures."""
TEXTURE_SIZE = 256
"""Side of a generated texture [pixel]."""
MAX_RAY_LENGTH = 5.0
"""Maximum length of a ray [m]."""
RAY_RESTART_DISTANCE = 1e-4
"""Distance behind a hit of the arm at which a ray is cast again [m]."""
MAX_REST_SPEED = 0.002
"""Speed below which an object counts as at rest [m/s]."""
MIN_SETTLING_STEPS = 60
"""Minimum number of physics steps until rest; released objects are slow in the first steps."""
MAX_SETTLING_STEPS = 480
"""Maximum number of physics steps until rest."""
MAX_DISPLACEMENT = 0.005
"""Maximum distance of an object in a stable stack from its goal [m]."""


class World(CellWorld):
    """A PyBullet world with the content of a cell file and loose objects.

    Args:
        config: The cell file.
        gui: True to show the world in a window.

    Attributes:
        labels: Class of each loose object, by body.
        models: Model of each loose object, by body.
        step_count: Number of physics steps.
        log: Log of the commands to the world, or None.
        is_idle: True during physics steps that belong to no control step of the run.
        rest_positions: Positions `(3,)` [m] of each object by body: initial position of the run, and position
            after each move by a test and after each release by the tool.
        removed_objects: The removed objects by body, without the forgotten ones.
        forgotten_count: Number of forgotten objects.
    """

    def __init__(self, config: CellConfig, *, gui: bool = False) -> None:
        super().__init__(config, gui=gui)
        shapes = self.client.getVisualShapeData(self.table, pybullet.VISUAL_SHAPE_DATA_TEXTURE_UNIQUE_IDS)
        self._textures = {PLAIN_TEXTURE: -1, WOOD_TEXTURE: int(shapes[0][8])}
        self.labels: dict[int, str] = {}
        self.models: dict[int, ObjectConfig] = {}
        self.step_count = 0
        self.log: CommandLog | None = None
        self.is_idle = False
        self._unlogged_targets: tuple[float, ...] = ()
        """Time in the motion [s] and joint positions [rad] of the last command; empty after the next step."""
        self.rest_positions: dict[int, list[Array]] = {}
        self.removed_objects: dict[int, TrueObject] = {}
        self.forgotten_count = 0

    def paint_table(self, colour: Colour, texture: str) -> None:
        """Give the table a texture of `TEXTURES`, with RGB values multiplied by `colour`."""
        if texture not in self._textures:
            seed = TEXTURES.index(texture)
            # PyBullet caches textures by path, so that each texture needs its own path.
            with tempfile.TemporaryDirectory() as folder:
                path = str(Path(folder) / f"{seed}.png")
                cv2.imwrite(path, generate_pattern(seed))
                self._textures[texture] = int(self.client.loadTexture(path))
        texture_id = self._textures[texture]
        self.client.changeVisualShape(self.table, -1, textureUniqueId=texture_id, rgbaColor=[*colour, 1])

    def add_object(
        self, label: str, X_WO: Pose, colour: Sequence[float], model: ObjectConfig | None = None
    ) -> int:
        """Add an object of the class `label` and return the body.

        Args:
            label: Class of the object.
            X_WO: Pose of the upright frame O of the object, whose z axis points up, in the world.
            colour: Red, green and blue, each 0 to 1.
            model: Model of the object; None: the model of the class in the cell file.
        """
        model = model or self.config.objects[label]
        body = add_body(self.client, model, X_WO)
        self.client.changeVisualShape(body, -1, rgbaColor=[*colour, 1])
        self.labels[body] = label
        self.models[body] = model
        return body

    def remove_object(self, body: int, *, is_counted: bool = True) -> None:
        """Remove a loose object from the world; unless it counts, forget it."""
        self.log_command(world_log.REMOVE if is_counted else world_log.FORGET, body)
        if is_counted:
            self.removed_objects[body] = replace(self.describe_object(body), is_removed=True)
        else:
            self.forgotten_count += 1
            self.rest_positions.pop(body, None)
        del self.labels[body]
        del self.models[body]
        self.client.removeBody(body)

    def describe_object(self, body: int) -> TrueObject:
        """Return the class, the present pose and the model of a loose object."""
        return TrueObject(self.labels[body], self.get_object_pose(body), body, model=self.models[body])

    def name_body(self, body: int) -> str:
        """Return the name of a body for messages; a robot does not know what objects are."""
        names = {self.table: "the table", self.floor: "the floor", self.arm: "the arm"}
        names |= {bin_body: name for name, bin_body in self.bin_bodies.items()}
        return names.get(body, "something")

    def get_object_pose(self, body: int) -> Pose:
        """Return the pose `X_WO` of the upright frame O of a loose object."""
        return locate_object(self.client, body, self.models[body])

    def place_object(self, body: int, X_WO: Pose) -> None:
        """Move a loose object to `X_WO`, at rest."""
        self.rest_positions.setdefault(body, []).append(X_WO.position)
        self.log_command(world_log.SET_POSE, body, *X_WO.position, *X_WO.quaternion)
        X_WI = X_WO @ compute_upright_pose(self.models[body]) @ get_inertial_pose(self.client, body)
        self.client.resetBasePositionAndOrientation(body, X_WI.position, X_WI.quaternion)

    def command_arm(self, q: Array, time: float = 0.0) -> None:
        """Command joint positions `q` `(n,)` [rad]; `time` [s] since the start of the motion is only logged.

        If a command precedes every physics step, the full position gain leaves a tracking error of 0.0005°.
        """
        self._unlogged_targets = (time, *q.tolist())
        self.client.setJointMotorControlArray(
            self.arm, self.joints, pybullet.POSITION_CONTROL, targetPositions=q.tolist(),
            forces=self.config.arm.effort, positionGains=[1.0] * len(q),
        )  # fmt: skip

    def log_command(self, kind: str, *arguments: float | str) -> None:
        """Append a command to the log, if the world has one, before its execution."""
        if self.log is not None:
            self.log.append(kind, *arguments)

    def cast_ray(self, origin: Array, direction: Array) -> Array | None:
        """Return the first point `(3,)` [m] of a ray on a body other than arm and tool, or None."""
        start = origin
        end = origin + MAX_RAY_LENGTH * direction / np.linalg.norm(direction)
        while True:
            body, _, fraction, point, _ = self.client.rayTest(start, end)[0]
            if body != self.arm:
                return np.array(point) if body >= 0 else None
            ray = end - start
            start = start + fraction * ray + RAY_RESTART_DISTANCE * ray / np.linalg.norm(ray)

    def step(self) -> None:
        """Advance the physics by 1/240 s."""
        kind = world_log.IDLE_STEP if self.is_idle else world_log.RUN_STEP
        self.log_command(kind, *self._unlogged_targets)
        self._unlogged_targets = ()
        self.client.stepSimulation()
        self.step_count += 1

    def settle(self, bodies: Collection[int], goals: Mapping[int, Pose] | None = None) -> None:
        """Step until all bodies are at rest or one has left its goal, at most `MAX_SETTLING_STEPS` times."""
        for step in range(MAX_SETTLING_STEPS):
            self.step()
            speeds = [np.linalg.norm(self.client.getBaseVelocity(body)[0]) for body in bodies]
            is_at_rest = step >= MIN_SETTLING_STEPS and max(speeds, default=0.0) < MAX_REST_SPEED
            if is_at_rest or self.has_moved(goals or {}):
                return

    def has_moved(self, goals: Mapping[int, Pose]) -> bool:
        """Return True if a body is more than `MAX_DISPLACEMENT` away from its pose in `goals`."""
        return any(
            float(np.linalg.norm(self.get_object_pose(body).position - X_WO.position)) > MAX_DISPLACEMENT
            for body, X_WO in goals.items()
        )

    def close(self) -> None:
        """Disconnect from the physics server; the world cannot be used afterwards."""
        if self.log is not None:
            self.log.close()
        super().close()


def generate_pattern(seed: int) -> NDArray[np.uint8]:
    """Return a bright random texture of `TEXTURE_SIZE`, RGB: clouds, stripes, tiles or speckles."""
    rng = np.random.default_rng(seed)
    contrast = rng.uniform(15, 90)
    count = int(rng.choice([4, 8, 16, 32]))
    pattern_kind = seed % 4  # clouds, stripes, tiles or speckles
    size = (TEXTURE_SIZE, TEXTURE_SIZE)
    shape = ((count, count, 3), (1, count * 2, 3), (count, count, 1), (*size, 1))[pattern_kind]
    interpolation = cv2.INTER_CUBIC if pattern_kind in (0, 3) else cv2.INTER_NEAREST
    values = (255 - rng.uniform(0, contrast, shape) * np.ones(3)).astype(np.float32)
    return np.asarray(cv2.resize(values, size, interpolation=interpolation).clip(0, 255), np.uint8)


TABLE_COLOUR = (0.86, 0.78, 0.66)
"""Mean colour of the texture of the table, RGB, each 0 to 1."""

_SHAPE_KINDS = {
    pybullet.GEOM_BOX: "box",
    pybullet.GEOM_CYLINDER: "cylinder",
    pybullet.GEOM_SPHERE: "sphere",
    pybullet.GEOM_MESH: "mesh",
}
"""Values of `Shape.kind`, by PyBullet's types of geometry."""


class SimVisuals:
    """Shapes of all bodies except the floor; implements `executive.cell.devices.Visuals`.

    A call of `poses` takes about 0.3 ms.

    Args:
        world: The world with all objects.

    Attributes:
        shapes: All shapes.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._link_indices = range(world.client.getNumJoints(world.arm))
        # Frame I: centre of mass, frame L: link. For a body without links, PyBullet returns the pose X_WI.
        self._X_IL = {body: get_inertial_pose(world.client, body).inverse() for body in world.labels}
        self.shapes: Sequence[Shape] = tuple(_make_shapes(world))

    def poses(self) -> Mapping[str, Pose]:
        client = self._world.client
        states = client.getLinkStates(self._world.arm, self._link_indices, computeForwardKinematics=True)
        poses_by_name = {f"link {number}": Pose.of(*state[4:6]) for number, state in enumerate(states, 1)}
        for body in self._world.labels:
            X_WI = Pose.of(*client.getBasePositionAndOrientation(body))
            poses_by_name[f"object {body}"] = X_WI @ self._X_IL[body]
        return poses_by_name


def _make_shapes(world: World) -> Iterator[Shape]:
    """Yield the shapes of arm, table, bins and objects; the name of a static shape is ""."""
    for body in (world.arm, world.table, *world.bin_bodies.values(), *world.labels):
        X_WI = Pose.of(*world.client.getBasePositionAndOrientation(body))
        X_WL = X_WI @ get_inertial_pose(world.client, body).inverse()
        for data in world.client.getVisualShapeData(body):
            _, link, geometry, size, file, position, quaternion, colour = data[:8]
            if geometry not in _SHAPE_KINDS:
                continue
            pose = Pose.of(position, quaternion)  # relative to the link of the arm or to the object
            name = f"object {body}" if body in world.labels else ""
            if body == world.arm and link >= 0:
                name = f"link {link + 1}"
            if not name:
                pose = X_WL @ pose
            # PyBullet returns height and radius of a cylinder, and the radius of a sphere.
            is_cylinder = geometry == pybullet.GEOM_CYLINDER
            lengths = (2 * size[1], 2 * size[1], size[0]) if is_cylinder else tuple(size)
            if geometry == pybullet.GEOM_SPHERE:
                lengths = (2 * size[0],) * 3
            rgb = TABLE_COLOUR if body == world.table else tuple(colour[:3])
            yield Shape(name, _SHAPE_KINDS[geometry], lengths, pose, rgb, file.decode())
