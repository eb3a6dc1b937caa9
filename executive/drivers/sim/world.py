"""PyBullet world of a cell: arm with tool, table, bins and loose objects, and their shapes for display.

The origin of the world frame W is at the base of the arm, on the table top. Worlds with equal cell files and
equal objects in equal order are bitwise identical.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from string import Template
from typing import Any

import cv2
import numpy as np
import pybullet
from numpy.typing import NDArray
from pybullet_utils.bullet_client import BulletClient

from executive.cell.arm_config import TOOL_LINK
from executive.cell.config import NECK_LENGTH, TOOL_RADIUS, BinConfig, CellConfig, ObjectConfig
from executive.cell.device_config import Colour
from executive.cell.objects import BIN_THICKNESS
from executive.cell.protocols import STEP
from executive.cell.workcell import Shape, TrueObject
from executive.drivers import world_log
from executive.drivers.sim.model_files import find_model
from executive.drivers.sim.models import add_body, compute_upright_pose, get_inertial_pose, locate_object
from executive.drivers.world_log import CommandLog
from executive.geometry import Array, Pose

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

TABLE_HEIGHT = 0.625
"""Height of the table in pybullet_data [m]."""
TABLE_CENTRE = (0.40, 0.0)
"""Centre of the table top in the world [m]; the table top is 1.0 m long along x and 1.5 m along y."""
CYLINDER_MARGIN = 0.001
"""Collision margin that Bullet adds on all sides to a cylinder of a URDF [m]."""
TOOL_MASS = 0.1
"""Mass of the tool [kg]."""
MAX_RAY_LENGTH = 5.0
"""Maximum length of a ray [m]."""
RAY_RESTART_DISTANCE = 1e-4
"""Distance behind a hit of the arm at which a ray is cast again [m]."""
# Indices of values in a contact point or closest point of PyBullet, for a query with the bodies A and B.
BODY_B = 2
LINK_A = 3
POSITION_A = 5
POSITION_B = 6
DISTANCE = 8
NORMAL_FORCE = 9
LINK_NAME = 12
"""Index of the name of the link in the information about a joint of PyBullet."""


class World:
    """A PyBullet world with the content of a cell file, the arm at `home`, without objects.

    Args:
        config: The cell file.
        gui: True to show the world in a window.
        visuals: False to load no visual shapes, which halves the loading time; camera images are then empty.

    Attributes:
        config: The cell file.
        client: The connection to the physics server, which identifies bodies by integers.
        arm: Body of the arm, fixed at the origin.
        joints: Indices of the joints of the arm, which are also the indices of the links up to the flange.
        flange_index: Index of the link with the flange.
        tool_index: Index of the link of the tool, whose frame is the frame of the flange.
        table, floor: Bodies of the table and of the floor under the table.
        bin_bodies: Body of each bin, by name.
        labels: Class of each loose object, by body.
        models: Model of each loose object, by body.
        step_count: Number of physics steps.
        log: Log of the commands to the world; each command is appended before its execution.
        is_idle: True during physics steps that belong to no control step of the run.
        rest_positions: Positions `(3,)` [m] of each object by body: initial position of the run, and position
            after each move by a test and after each release by the tool.
        removed_objects: The removed objects by body.
    """

    def __init__(self, config: CellConfig, *, gui: bool = False, visuals: bool = True) -> None:
        self.config = config
        self.client = BulletClient(pybullet.GUI if gui else pybullet.DIRECT)
        self.client.setGravity(0, 0, -9.81)
        self.client.setTimeStep(STEP)
        self.client.setPhysicsEngineParameter(deterministicOverlappingPairs=1)
        flags = 0 if visuals else pybullet.URDF_IGNORE_VISUAL_SHAPES
        self.floor = self.client.loadURDF(str(find_model("plane.urdf")), [0, 0, -TABLE_HEIGHT], flags=flags)
        urdf = str(find_model("table/table.urdf"))
        position = [*TABLE_CENTRE, -TABLE_HEIGHT]
        quaternion = self.client.getQuaternionFromEuler([0, 0, np.pi / 2])
        self.table = self.client.loadURDF(urdf, position, quaternion, useFixedBase=True, flags=flags)
        shapes = self.client.getVisualShapeData(self.table, pybullet.VISUAL_SHAPE_DATA_TEXTURE_UNIQUE_IDS)
        # A world without visual shapes needs no textures.
        self._textures = {PLAIN_TEXTURE: -1, WOOD_TEXTURE: shapes[0][8] if shapes else -1}
        self.arm = self._load_arm(flags)
        self._link_indices = {
            self.client.getJointInfo(self.arm, index)[LINK_NAME].decode(): index
            for index in range(self.client.getNumJoints(self.arm))
        }
        self.flange_index = self.find_link(config.arm.flange.link)
        self.tool_index = self.find_link(TOOL_LINK)
        self.joints = range(self.flange_index + 1)
        self.bin_bodies = {name: add_bin(self.client, bin) for name, bin in config.bins.items()}
        self.labels: dict[int, str] = {}
        self.models: dict[int, ObjectConfig] = {}
        self.step_count = 0
        self.log = CommandLog()
        self.is_idle = False
        self.rest_positions: dict[int, list[Array]] = {}
        self.removed_objects: dict[int, TrueObject] = {}
        self.set_joint_positions(np.radians(config.arm.poses_deg["home"]))

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

    def remove_object(self, body: int) -> None:
        """Remove a loose object from the world."""
        self.log.append(world_log.REMOVE, body)
        self.removed_objects[body] = replace(self.describe_object(body), is_removed=True)
        del self.labels[body]
        del self.models[body]
        self.client.removeBody(body)

    def describe_object(self, body: int) -> TrueObject:
        """Return the class, the present pose and the model of a loose object."""
        return TrueObject(self.labels[body], self.get_object_pose(body), body, model=self.models[body])

    def name_body(self, body: int) -> str:
        """Return the name of a body for messages."""
        names = {self.table: "the table", self.floor: "the floor", self.arm: "the arm"}
        names |= {bin_body: name for name, bin_body in self.bin_bodies.items()}
        return f"a {self.labels[body]}" if body in self.labels else names.get(body, "something unknown")

    def find_link(self, name: str) -> int:
        """Return the index of a link of the arm, by its name in the URDF."""
        return self._link_indices[name]

    def name_link(self, link: int) -> str:
        """Return the name of a link of the arm for messages, by its index."""
        return "the tool" if link == self.tool_index else f"link {link + 1}"

    def get_object_pose(self, body: int) -> Pose:
        """Return the pose `X_WO` of the upright frame O of a loose object."""
        return locate_object(self.client, body, self.models[body])

    def place_object(self, body: int, X_WO: Pose) -> None:
        """Move a loose object to `X_WO`, at rest."""
        self.rest_positions.setdefault(body, []).append(X_WO.position)
        self.log.append(world_log.SET_POSE, body, *X_WO.position, *X_WO.quaternion)
        X_WI = X_WO @ compute_upright_pose(self.models[body]) @ get_inertial_pose(self.client, body)
        self.client.resetBasePositionAndOrientation(body, X_WI.position, X_WI.quaternion)

    def get_joint_positions(self) -> Array:
        """Return the joint positions of the arm `(n,)` [rad]."""
        states = self.client.getJointStates(self.arm, self.joints)
        return np.array([state[0] for state in states])

    def set_joint_positions(self, q: Sequence[float] | Array) -> None:
        """Move the arm to joint positions `q` `(n,)` [rad] at once, without physics or collision checks."""
        for joint, angle in enumerate(q):
            self.client.resetJointState(self.arm, joint, angle)

    def command_arm(self, q: Array, time: float = 0.0) -> None:
        """Command joint positions `q` `(n,)` [rad]; `time` [s] since the start of the motion is only logged.

        If a command precedes every physics step, the full position gain leaves a tracking error of 0.0005°.
        """
        self.log.append(world_log.JOINT_TARGETS, time, *q)
        self.client.setJointMotorControlArray(
            self.arm, self.joints, pybullet.POSITION_CONTROL, targetPositions=q.tolist(),
            forces=self.config.arm.effort, positionGains=[1.0] * len(q),
        )  # fmt: skip

    def get_flange_pose(self) -> Pose:
        """Return `X_WF`, the pose of the flange."""
        state = self.client.getLinkState(self.arm, self.flange_index, computeForwardKinematics=True)
        return Pose.of(*state[4:6]) @ Pose.of([0, 0, self.config.arm.flange.offset])

    def get_tool_pose(self) -> Pose:
        """Return `X_WT`, the pose of the tool centre point: the centre of the lip of the cup."""
        return self.get_flange_pose() @ Pose.of([0, 0, self.config.tool.length])

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
        self.log.append(world_log.IDLE_STEP if self.is_idle else world_log.RUN_STEP)
        self.client.stepSimulation()
        self.step_count += 1

    def close(self) -> None:
        """Disconnect from the physics server; the world cannot be used afterwards."""
        self.log.close()
        self.client.disconnect()

    def _load_arm(self, flags: int) -> int:
        """Load the arm with the tool as an additional fixed link, and return the body.

        A fixed link has no drift, in contrast to a constraint between two bodies. PyBullet by default
        ignores collisions between links of one body, so that tool and wrist may overlap.
        """
        path = find_model(self.config.arm.urdf)
        text = path.read_text().replace('filename="meshes/', f'filename="{path.parent}/meshes/')
        tool = self.config.tool
        values: dict[str, Any] = {"centre": tool.length / 2, "mass": TOOL_MASS}
        shaft_length = tool.length - NECK_LENGTH
        for part, length, radius, centre in (
            ("shaft", shaft_length, TOOL_RADIUS, shaft_length / 2),
            ("neck", NECK_LENGTH, tool.cup_radius, tool.length - NECK_LENGTH / 2),
        ):
            values |= {f"{part}_length": length, f"{part}_radius": radius, f"{part}_centre": centre}
            values[f"{part}_collision_length"] = length - 2 * CYLINDER_MARGIN
            values[f"{part}_collision_radius"] = radius - CYLINDER_MARGIN
        values |= {"flange_link": self.config.arm.flange.link, "flange_offset": self.config.arm.flange.offset}
        template = Template(Path(__file__).with_name("tool.urdf").read_text())
        text = text.replace("</robot>", template.substitute(values))
        with tempfile.TemporaryDirectory() as folder:
            urdf_path = Path(folder) / "arm_with_tool.urdf"
            urdf_path.write_text(text)
            return int(self.client.loadURDF(str(urdf_path), useFixedBase=True, flags=flags))


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


def name_load(label: str) -> str:
    """Return the name of a held object of class `label` for messages."""
    return f"the held {label}"


def add_bin(client: BulletClient, bin: BinConfig) -> int:
    """Create the static body of a bin, with floor and walls, and return the body."""
    length, width, height = bin.size
    x = (length + BIN_THICKNESS) / 2
    y = (width + BIN_THICKNESS) / 2
    z = height / 2
    floor = [length / 2 + BIN_THICKNESS, width / 2 + BIN_THICKNESS, BIN_THICKNESS / 2]
    end_wall = [BIN_THICKNESS / 2, width / 2 + BIN_THICKNESS, z]
    side_wall = [length / 2, BIN_THICKNESS / 2, z]
    half_sizes = [floor, end_wall, end_wall, side_wall, side_wall]
    centres = [[0, 0, BIN_THICKNESS / 2], [x, 0, z], [-x, 0, z], [0, y, z], [0, -y, z]]
    shape = {"shapeTypes": [pybullet.GEOM_BOX] * len(half_sizes), "halfExtents": half_sizes}
    colours = [[*bin.colour, 1]] * len(half_sizes)
    collision = client.createCollisionShapeArray(**shape, collisionFramePositions=centres)
    visual = client.createVisualShapeArray(**shape, visualFramePositions=centres, rgbaColors=colours)
    return int(client.createMultiBody(0, collision, visual, bin.position))


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
    """Shapes of all bodies except the floor; implements `executive.cell.workcell.Visuals`.

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
