"""PyBullet world of a cell: arm with tool, table, bins and loose objects, and their shapes for display.

The origin of the world frame W is at the base of the arm, on the table top. Worlds with equal cell files and
equal objects in equal order are bitwise identical.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from string import Template

import cv2
import numpy as np
import pybullet
from numpy.typing import NDArray
from pybullet_utils.bullet_client import BulletClient

from executive.cell.config import BinConfig, CellConfig, ObjectConfig
from executive.cell.device_config import Colour
from executive.cell.objects import BIN_THICKNESS
from executive.cell.protocols import STEP
from executive.cell.workcell import Shape, TrueObject
from executive.drivers import world_log
from executive.drivers.sim.model_files import find_model
from executive.drivers.sim.models import add_body, compute_upright_pose, get_inertial_pose, locate_object
from executive.drivers.world_log import CommandLog
from executive.geometry import Array, Pose
from executive.motion.iiwa14_kinematics import FLANGE_OFFSET

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


@dataclass(frozen=True)
class RobotModel:
    """PyBullet model of an arm in which each link up to the flange has its own joint.

    Link indices are those of PyBullet. The tool is the link after the link of the flange.

    Attributes:
        flange_link: Name of the link with the flange.
        flange_offset: Distance from the origin of the flange link to the flange along the link's z axis [m].
        max_torques: Maximum torque of each joint [Nm].
        first_collision_link: Index of the first link that can collide with other bodies.
        wrist_link: Index of the first link of the wrist, whose links a held object is permitted to touch.
        self_collision_pairs: Pairs of indices of links that can collide with each other.
        link_radius: Radius of a cylinder around the housing of each link [m].
        ik_seed_deg: Start of the numerical inverse kinematics: positions of joints 2 and higher [degree].
    """

    flange_link: str
    flange_offset: float
    max_torques: tuple[float, ...]
    first_collision_link: int
    wrist_link: int
    self_collision_pairs: tuple[tuple[int, int], ...]
    link_radius: float
    ik_seed_deg: tuple[float, ...]


ROBOT_MODELS: Mapping[str, RobotModel] = {
    "kuka_iiwa/model.urdf": RobotModel(
        flange_link="lbr_iiwa_link_7",
        flange_offset=FLANGE_OFFSET,
        # From the data sheet, as in iiwa_description of RobotLocomotion/models.
        max_torques=(320.0, 320.0, 176.0, 176.0, 110.0, 40.0, 40.0),
        # Link 1 (index 0) only turns about the axis of the base.
        first_collision_link=1,
        wrist_link=5,
        # In 1500 random poses, 121 of 131 self-collisions were between links 5 and 7 (indices 4 and 6).
        # A long tool (index 7) also collides with the lowest links (indices 0 to 2), mostly with the first.
        self_collision_pairs=((4, 6), (7, 0), (7, 1), (7, 2)),
        link_radius=0.09,
        ik_seed_deg=(30, 0, -85, 0, 65, 0),
    )
}
"""Model of each supported arm, by the value of `arm.urdf` in a cell file."""


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
        robot: Model of the arm.
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
        self.robot = ROBOT_MODELS[config.arm.urdf]
        self.joints = range(len(self.robot.max_torques))
        self.flange_index = self.joints[-1]
        self.tool_index = len(self.joints)
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
            forces=self.robot.max_torques, positionGains=[1.0] * len(q),
        )  # fmt: skip

    def get_flange_pose(self) -> Pose:
        """Return `X_WF`, the pose of the flange."""
        state = self.client.getLinkState(self.arm, self.flange_index, computeForwardKinematics=True)
        return Pose.of(*state[4:6]) @ Pose.of([0, 0, self.robot.flange_offset])

    def get_tool_pose(self) -> Pose:
        """Return `X_WT`, the pose of the tool centre point."""
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
        text_of_tool, text_of_part = Path(__file__).with_name("tool.urdf").read_text().split("</robot>\n")
        part_template = Template(text_of_part)
        parts = "".join(
            part_template.substitute(
                centre=tool.length - part.offset - part.length / 2,
                length=part.length,
                radius=part.radius,
                collision_length=part.length - 2 * CYLINDER_MARGIN,
                collision_radius=part.radius - CYLINDER_MARGIN,
            )
            for part in tool.parts
        )
        values = {"flange_link": self.robot.flange_link, "flange_offset": self.robot.flange_offset}
        values |= {"centre": tool.length / 2, "mass": TOOL_MASS, "parts": parts}
        text = text.replace("</robot>", Template(text_of_tool).substitute(values) + "</robot>")
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
