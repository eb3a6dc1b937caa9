"""The simulated world of a cell: arm with tool, table, bins and loose objects in PyBullet.

The world frame W stands at the foot of the arm, on the table top. Rebuilding a world from the same
cell file and adding the same objects in the same order gives the same bits.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pybullet
from pybullet_utils.bullet_client import BulletClient

from executive.cell.clock import STEP
from executive.cell.config import BinConfig, CellConfig, ObjectConfig
from executive.cell.layout import NECK_LENGTH, TOOL_RADIUS, bin_walls
from executive.cells.sim import command_log
from executive.cells.sim.command_log import CommandLog
from executive.cells.sim.model_files import find_model
from executive.cells.sim.models import add_body, upright
from executive.cells.sim.robot_models import ROBOT_MODELS, RobotModel
from executive.cells.sim.table_top import TableTop
from executive.geometry import Array, Pose

TABLE_HEIGHT = 0.625
"""Height of the top of pybullet_data's table over its feet [m]."""
TABLE_CENTRE = (0.40, 0.0)
"""Centre of the table top [m]; it is 1.0 m long along x and 1.5 m along y."""
CYLINDER_MARGIN = 0.001
"""What Bullet adds all around a URDF's cylinder when it collides [m]."""
TOOL_MASS = 0.1
"""Mass of the tool [kg]."""
RAY_LENGTH, RAY_STEP = 5.0, 1e-4
"""Length of a ray, and the distance behind the arm's surface at which it goes on [m]."""


class World:
    """A PyBullet world with everything a cell file describes, arm at `home`, no objects yet.

    Args:
        config: The cell file.
        gui: Show it in a window.
        visuals: Load what is to be seen; without it a world is made in half the time, and no camera sees it.

    Attributes:
        client: The connection to the physics server.
        arm: Body of the arm, fixed at the origin.
        robot: Model of the arm.
        flange: Index of the link with the flange.
        tool: Index of the tool's link, whose frame is the flange's.
        table, plane: Bodies of the table and of the floor under it.
        table_top: The surface of the table.
        bins: Bodies of each bin.
        bodies: Label of every loose object, by body.
        models: Model of every loose object, by body.
        steps: Physics steps made so far.
        log: Where all that is done to it is noted, before it is done.
        idle: True while it is stepped for nobody's run.
        stood: Where loose objects `(3,)` [m] were put or released after they had been added, by body.
        removed: Class and last position `(3,)` [m] of each object that somebody took away, by body.
    """

    def __init__(self, config: CellConfig, *, gui: bool = False, visuals: bool = True) -> None:
        self.config = config
        self.robot = ROBOT_MODELS[config.arm.urdf]
        self.flange, self.tool = self.robot.joint_count - 1, self.robot.joint_count
        self.client = BulletClient(pybullet.GUI if gui else pybullet.DIRECT)
        self.client.setGravity(0, 0, -9.81)
        self.client.setTimeStep(STEP)
        self.client.setPhysicsEngineParameter(deterministicOverlappingPairs=1)
        flags = 0 if visuals else pybullet.URDF_IGNORE_VISUAL_SHAPES
        self.plane = self.client.loadURDF(str(find_model("plane.urdf")), [0, 0, -TABLE_HEIGHT], flags=flags)
        self.table = self.client.loadURDF(
            str(find_model("table/table.urdf")),
            [*TABLE_CENTRE, -TABLE_HEIGHT],
            self.client.getQuaternionFromEuler([0, 0, np.pi / 2]),
            useFixedBase=True,
            flags=flags,
        )
        self.table_top = TableTop(self.client, self.table)
        self.arm = self._load_arm(flags)
        self.bins = {name: (add_bin(self.client, bin),) for name, bin in config.bins.items()}
        self.bodies: dict[int, str] = {}
        self.models: dict[int, ObjectConfig] = {}
        self.steps = 0
        self.log = CommandLog()
        self.idle = False
        self.stood: dict[int, list[Array]] = {}
        self.removed: dict[int, tuple[str, Array]] = {}
        self.set_arm(np.radians(config.arm.poses_deg["home"]))

    def add_object(
        self, label: str, X_WO: Pose, colour: Sequence[float], model: ObjectConfig | None = None
    ) -> int:
        """Put an object of class `label` at `X_WO` (z up as it stands) and return its body.

        By default its model is that of the cell file.
        """
        model = model or self.config.objects[label]
        body = add_body(self.client, model, X_WO)
        self.client.changeVisualShape(body, -1, rgbaColor=[*colour, 1])
        self.bodies[body], self.models[body] = label, model
        return body

    def remove_object(self, body: int) -> None:
        """Take a loose object out of the world."""
        self.log.note(command_log.REMOVE, body)
        self.removed[body] = self.bodies[body], self.object_pose(body).position
        del self.bodies[body], self.models[body]
        self.client.removeBody(body)

    def name_of(self, body: int) -> str:
        """Return what a body is, for the text of an error."""
        for name, bodies in {"the table": (self.table,), "the floor": (self.plane,), **self.bins}.items():
            if body in bodies:
                return name
        return f"a {self.bodies[body]}" if body in self.bodies else "the arm"

    def part_of(self, link: int) -> str:
        """Return which part of the arm a link is, by its index, for the text of an error."""
        return "the tool" if link == self.tool else f"link {link + 1}"

    def object_pose(self, body: int) -> Pose:
        """Return `X_WO` of a loose object, the frame that `add_object` takes."""
        X_WI = Pose.of(*self.client.getBasePositionAndOrientation(body))
        X_LI = Pose.of(*self.client.getDynamicsInfo(body, -1)[3:5])
        return X_WI @ X_LI.inverse() @ upright(self.models[body]).inverse()

    def place_object(self, body: int, X_WO: Pose) -> None:
        """Move a loose object to `X_WO`, at rest."""
        self.stood.setdefault(body, []).append(X_WO.position)
        self.log.note(command_log.PLACE, body, *X_WO.position, *X_WO.quaternion)
        X_LI = Pose.of(*self.client.getDynamicsInfo(body, -1)[3:5])
        X_WI = X_WO @ upright(self.models[body]) @ X_LI
        self.client.resetBasePositionAndOrientation(body, X_WI.position, X_WI.quaternion)

    def set_arm(self, q: Sequence[float] | Array) -> None:
        """Put the arm at joint positions `q` `(n,)` [rad], at rest, whatever is in the way."""
        for joint, angle in enumerate(q):
            self.client.resetJointState(self.arm, joint, angle)

    def command_arm(self, q: Array, time: float = 0.0) -> None:
        """Have the arm's motors go to joint positions `q` `(n,)` [rad], `time` [s] on the path of its motion.

        Full position gain and no velocity: sent before every step, it follows a path to 0.0005°.
        """
        self.log.note(command_log.JOINTS_TO, time, *q)
        self.client.setJointMotorControlArray(
            self.arm,
            range(self.robot.joint_count),
            pybullet.POSITION_CONTROL,
            targetPositions=q.tolist(),
            forces=self.robot.torques,
            positionGains=[1.0] * self.robot.joint_count,
        )

    def flange_pose(self) -> Pose:
        """Return `X_WF`, the pose of the flange."""
        state = self.client.getLinkState(self.arm, self.flange, computeForwardKinematics=True)
        return Pose.of(*state[4:6]) @ Pose.of([0, 0, self.robot.flange_offset])

    def tool_pose(self) -> Pose:
        """Return `X_WT`, the pose of the tool centre point: the middle of the cup's lip."""
        return self.flange_pose() @ Pose.of([0, 0, self.config.tool.length])

    def cast_ray(self, origin: Array, direction: Array) -> Array | None:
        """Return the first point `(3,)` [m] that a ray hits, the arm and its tool being air, or None."""
        end = origin + RAY_LENGTH * direction / np.linalg.norm(direction)
        start = origin
        while True:
            body, _, share, point, _ = self.client.rayTest(start, end)[0]
            if body != self.arm:
                return np.array(point) if body >= 0 else None
            start = start + share * (end - start) + RAY_STEP * (end - start) / np.linalg.norm(end - start)

    def step(self) -> None:
        """Advance the physics by 1/240 s."""
        self.log.note(command_log.IDLE if self.idle else command_log.STEP)
        self.client.stepSimulation()
        self.steps += 1

    def close(self) -> None:
        """Give the physics server back; the world cannot be used afterwards."""
        self.log.close()
        self.client.disconnect()

    def _load_arm(self, flags: int) -> int:
        """Load the arm with the tool as one more fixed link: no constraint whose error could drift.

        Bodies do not collide with themselves (PyBullet's default), so the tool never fights the wrist.
        """
        path = find_model(self.config.arm.urdf)
        text = path.read_text().replace('filename="meshes/', f'filename="{path.parent}/meshes/')
        tool = self.config.tool
        text = text.replace("</robot>", _tool_link(tool.length, tool.cup_radius, self.robot))
        with tempfile.TemporaryDirectory() as folder:
            generated = Path(folder) / "arm_with_tool.urdf"
            generated.write_text(text)
            return int(self.client.loadURDF(str(generated), useFixedBase=True, flags=flags))


def held_part(label: str) -> str:
    """Return what an object of class `label` is while it hangs at the tool, for the text of an error."""
    return f"the held {label}"


def add_bin(client: BulletClient, bin: BinConfig) -> int:
    """Build floor and walls as one static body standing at the bin's position, and return it."""
    halves, places = map(list, zip(*bin_walls(bin.size), strict=True))
    shape = {"shapeTypes": [pybullet.GEOM_BOX] * len(halves), "halfExtents": halves}
    return int(
        client.createMultiBody(
            baseMass=0,
            baseCollisionShapeIndex=client.createCollisionShapeArray(**shape, collisionFramePositions=places),
            baseVisualShapeIndex=client.createVisualShapeArray(
                **shape, visualFramePositions=places, rgbaColors=[[*bin.colour, 1]] * len(halves)
            ),
            basePosition=bin.position,
        )
    )


def _tool_link(length: float, cup_radius: float, robot: RobotModel) -> str:
    """Return the URDF text of the tool, from the flange to the lip, and the closing tag."""
    body = length - NECK_LENGTH
    parts = [(body, TOOL_RADIUS, body / 2), (NECK_LENGTH, cup_radius, length - NECK_LENGTH / 2)]
    shapes = "".join(
        f'<{kind}><origin xyz="0 0 {z}"/><geometry>'
        f'<cylinder length="{size - 2 * less}" radius="{radius - less}"/></geometry>'
        + ('<material name="Grey"/>' if kind == "visual" else "")
        + f"</{kind}>"
        for size, radius, z in parts
        for kind, less in (("visual", 0.0), ("collision", CYLINDER_MARGIN))
    )
    return f"""
  <link name="tool">
    <inertial><origin xyz="0 0 {length / 2}"/><mass value="{TOOL_MASS}"/>
      <inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-5"/></inertial>
    {shapes}
  </link>
  <joint name="tool_joint" type="fixed">
    <parent link="{robot.flange_link}"/><child link="tool"/><origin xyz="0 0 {robot.flange_offset}"/>
  </joint>
</robot>
"""
