"""PyBullet model of a cell: arm with tool, table and bins, without objects and without time.

The origin of the world frame W is at the base of the arm, on the table top.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from string import Template

import numpy as np
import pybullet
from pybullet_utils.bullet_client import BulletClient

from executive.cell.arm_config import TOOL_LINK
from executive.cell.config import BinConfig, CellConfig
from executive.cell.device_config import STEP
from executive.cell.objects import BIN_THICKNESS
from executive.geometry import Array, Pose
from executive.physics.model_files import find_model

TABLE_HEIGHT = 0.625
"""Height of the table in pybullet_data [m]."""
TABLE_CENTRE = (0.40, 0.0)
"""Centre of the table top in the world [m]; the table top is 1.0 m long along x and 1.5 m along y."""
CYLINDER_MARGIN = 0.001
"""Collision margin that Bullet adds on all sides to a cylinder of a URDF [m]."""
TOOL_MASS = 0.1
"""Mass of the tool [kg]."""
# Indices of values in a contact point or closest point of PyBullet, for a query with the bodies A and B.
BODY_B = 2
LINK_A = 3
POSITION_A = 5
POSITION_B = 6
DISTANCE = 8
NORMAL_FORCE = 9
LINK_NAME = 12
"""Index of the name of the link in the information about a joint of PyBullet."""


class CellWorld:
    """A PyBullet world with arm, tool, table and bins of a cell file, the arm at `home`.

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
        self.arm = self._load_arm(flags)
        self._link_indices = {
            self.client.getJointInfo(self.arm, index)[LINK_NAME].decode(): index
            for index in range(self.client.getNumJoints(self.arm))
        }
        self.flange_index = self.find_link(config.arm.flange.link)
        self.tool_index = self.find_link(TOOL_LINK)
        self.joints = range(self.flange_index + 1)
        self.bin_bodies = {name: add_bin(self.client, bin) for name, bin in config.bins.items()}
        self.set_joint_positions(np.radians(config.arm.poses_deg["home"]))

    def find_link(self, name: str) -> int:
        """Return the index of a link of the arm, by its name in the URDF."""
        return self._link_indices[name]

    def name_link(self, link: int) -> str:
        """Return the name of a link of the arm for messages, by its index."""
        return "the tool" if link == self.tool_index else f"link {link + 1}"

    def get_joint_positions(self) -> Array:
        """Return the joint positions of the arm `(n,)` [rad]."""
        states = self.client.getJointStates(self.arm, self.joints)
        return np.array([state[0] for state in states])

    def set_joint_positions(self, q: Sequence[float] | Array) -> None:
        """Move the arm to joint positions `q` `(n,)` [rad] at once, without physics or collision checks."""
        for joint, angle in enumerate(q):
            self.client.resetJointState(self.arm, joint, angle)

    def get_flange_pose(self) -> Pose:
        """Return `X_WF`, the pose of the flange."""
        state = self.client.getLinkState(self.arm, self.flange_index, computeForwardKinematics=True)
        return Pose.of(*state[4:6]) @ Pose.of([0, 0, self.config.arm.flange.offset])

    def get_tool_pose(self) -> Pose:
        """Return `X_WT`, the pose of the tool centre point."""
        return self.get_flange_pose() @ Pose.of([0, 0, self.config.tool.length])

    def close(self) -> None:
        """Disconnect from the physics server; the world cannot be used afterwards."""
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
        flange = self.config.arm.flange
        values = {"flange_link": flange.link, "flange_offset": flange.offset}
        values |= {"centre": tool.length / 2, "mass": TOOL_MASS, "parts": parts}
        text = text.replace("</robot>", Template(text_of_tool).substitute(values) + "</robot>")
        with tempfile.TemporaryDirectory() as folder:
            urdf_path = Path(folder) / "arm_with_tool.urdf"
            urdf_path.write_text(text)
            return int(self.client.loadURDF(str(urdf_path), useFixedBase=True, flags=flags))


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
