"""PyBullet model of a cell: arm with tool, table and bins, without objects and without time.

The origin of the world frame W is on the table top.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pybullet
from pybullet_utils.bullet_client import BulletClient

from executive.arms.urdf import MAX_AXIS_ANGLE, find_model, read_chain
from executive.cell.arm_config import TOOL_LINK
from executive.cell.config import BinConfig, CellConfig
from executive.cell.device_config import STEP
from executive.cell.objects import BIN_THICKNESS
from executive.geometry import Array, Pose
from executive.physics.arm_model import build_arm_urdf

TABLE_HEIGHT = 0.625
"""Height of the table in pybullet_data [m]."""
TABLE_CENTRE = (0.40, 0.0)
"""Centre of the table top in the world [m]; the table top is 1.0 m long along x and 1.5 m along y."""
# Indices of values in a contact point or closest point of PyBullet, for a query with the bodies A and B.
BODY_B = 2
LINK_A = 3
POSITION_A = 5
POSITION_B = 6
NORMAL = 7
DISTANCE = 8
NORMAL_FORCE = 9
JOINT_TYPE = 2
"""Index of the type of the joint in the information about a joint of PyBullet."""
JOINT_NAME = 1
"""Index of the name of the joint in the information about a joint of PyBullet."""
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
        arm: Body of the arm, fixed at its base, with the tool.
        arm_urdf: URDF of this body.
        joints: Indices of the joints of the arm, which are also the indices of the links that they move.
        joint_counts: Number of joints before each link of the arm, by the index of the link; -1: the base.
        has_vertical_axis: True if the axis of the first joint is vertical.
        tool_index: Index of the link of the tool, whose frame is the frame of the flange.
        tool_links: Indices of all links of the tool.
        tool_joints: Indices of the moving joints of the tool, by name, which are also those of their links.
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
        self.arm_urdf = build_arm_urdf(config, visuals=visuals)
        base = config.arm.base
        turn = self.client.getQuaternionFromEuler([0, 0, math.radians(base.yaw_deg)])
        # PyBullet ignores collisions between links of one body, so that tool and wrist may overlap.
        self.arm = load_urdf_text(
            self.client, self.arm_urdf, basePosition=base.position, baseOrientation=turn, flags=flags
        )
        infos = [
            self.client.getJointInfo(self.arm, index) for index in range(self.client.getNumJoints(self.arm))
        ]
        link_names = [info[LINK_NAME].decode() for info in infos]
        chain = read_chain(config.arm.urdf, config.arm.flange)
        self.has_vertical_axis = bool(abs(chain.offsets[0].rotation[2, 2]) > math.cos(MAX_AXIS_ANGLE))
        # The first link of the chain is the base.
        self._link_names = [next(iter(chain.places)), *link_names]
        self.tool_index = self.find_link(TOOL_LINK)
        joint_names = [info[JOINT_NAME].decode() for info in infos]
        self.joints = [joint_names.index(name) for name in chain.joints]
        # The links of the tool are the only ones that do not belong to the chain.
        counts = {name: count for name, (count, _) in chain.places.items()}
        link_counts = [counts.get(name, len(self.joints)) for name in link_names]
        self.joint_counts = {-1: 0, **dict(enumerate(link_counts))}
        self.tool_links = [index for index, name in enumerate(link_names) if name not in counts]
        self.tool_joints = {
            name: index
            for index, name in enumerate(joint_names)
            if index in self.tool_links and infos[index][JOINT_TYPE] != pybullet.JOINT_FIXED
        }
        self.set_opening(config.tool.max_opening)
        self.bin_bodies = {name: add_bin(self.client, bin) for name, bin in config.bins.items()}
        self.set_joint_positions(np.radians(config.arm.poses_deg["home"]))

    def find_link(self, name: str) -> int:
        """Return the index of a link of the arm, by its name in the URDF; -1 for the base."""
        return self._link_names.index(name) - 1

    def set_opening(self, opening: float) -> None:
        """Move the fingers of the tool to a distance [m] at once, without physics."""
        for name, position in self.config.tool.compute_joint_positions(opening).items():
            self.client.resetJointState(self.arm, self.tool_joints[name], position)

    def get_link_name(self, link: int) -> str:
        """Return the name of a link of the arm in the URDF, by its index."""
        return self._link_names[link + 1]

    def name_link(self, link: int) -> str:
        """Return the name of a link of the arm for messages, by its index."""
        if link in self.tool_links:
            return "the tool"
        count = self.joint_counts[link]
        return f"link {count}" if count else "the base of the arm"

    def get_joint_positions(self) -> Array:
        """Return the joint positions of the arm `(n,)` [rad]."""
        states = self.client.getJointStates(self.arm, self.joints)
        return np.array([state[0] for state in states])

    def set_joint_positions(self, q: Sequence[float] | Array) -> None:
        """Move the arm to joint positions `q` `(n,)` [rad] at once, without physics or collision checks."""
        for joint, angle in zip(self.joints, q, strict=True):
            self.client.resetJointState(self.arm, joint, angle)

    def get_flange_pose(self) -> Pose:
        """Return `X_WF`, the pose of the flange."""
        state = self.client.getLinkState(self.arm, self.tool_index, computeForwardKinematics=True)
        return Pose.of(*state[4:6])

    def get_tool_pose(self) -> Pose:
        """Return `X_WT`, the pose of the tool centre point."""
        return self.get_flange_pose() @ Pose.of([0, 0, self.config.tool.length])

    def close(self) -> None:
        """Disconnect from the physics server; the world cannot be used afterwards."""
        self.client.disconnect()


def load_urdf_text(client: BulletClient, text: str, **options: Any) -> int:
    """Load a URDF from its text as a fixed body, and return the body; `options` are those of `loadURDF`."""
    # PyBullet stores models by their path; the name of the folder is new.
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.urdf"
        path.write_text(text, encoding="utf-8")
        return int(client.loadURDF(str(path), useFixedBase=True, **options))


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
