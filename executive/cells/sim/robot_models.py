"""PyBullet models of the supported arms: links, motors, and the link pairs that can collide."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from executive.motion.iiwa14_kinematics import FLANGE_OFFSET


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

    @property
    def joint_count(self) -> int:
        """Number of joints."""
        return len(self.max_torques)


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
