"""Supported arms as PyBullet models: links, motors, and the link pairs that can collide."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from executive.motion.iiwa14_kinematics import FLANGE_OFFSET


@dataclass(frozen=True)
class RobotModel:
    """PyBullet model of an arm whose first links, up to the flange, are moved by one joint each.

    Link indices are those of PyBullet. The tool is the link after the link of the flange.

    Attributes:
        flange_link: Name of the link with the flange.
        flange_offset: Distance from the origin of that link to the flange along the z axis of the link [m].
        torques: Maximum torque of each joint [Nm].
        first_moving_link: Lowest link that can approach other bodies.
        wrist_link: Lowest link that a held object may touch, because the object hangs there.
        self_pairs: Pairs of links that can collide with each other.
        link_radius: Radius of the circle around the housing of each link [m].
        forward_pose_deg: Joint positions, after the first, of a posture from which the inverse kinematics
            reaches all places on the table [degree].
    """

    flange_link: str
    flange_offset: float
    torques: tuple[float, ...]
    first_moving_link: int
    wrist_link: int
    self_pairs: tuple[tuple[int, int], ...]
    link_radius: float
    forward_pose_deg: tuple[float, ...]

    @property
    def joint_count(self) -> int:
        """Number of joints."""
        return len(self.torques)


ROBOT_MODELS: Mapping[str, RobotModel] = {
    "kuka_iiwa/model.urdf": RobotModel(
        flange_link="lbr_iiwa_link_7",
        flange_offset=FLANGE_OFFSET,
        # Data sheet, as in RobotLocomotion/models iiwa_description.
        torques=(320.0, 320.0, 176.0, 176.0, 110.0, 40.0, 40.0),
        # The base and link 1 only turn about the axis of the base.
        first_moving_link=1,
        wrist_link=5,
        # In 1500 random poses, 121 of 131 self-collisions were between links 5 and 7 (indices 4 and 6).
        # Longer tools also collide with the base and with links 1 and 2, most often with the base.
        self_pairs=((4, 6), (7, 0), (7, 1), (7, 2)),
        link_radius=0.09,
        forward_pose_deg=(30, 0, -85, 0, 65, 0),
    )
}
"""Model of each supported arm, by the value of `arm.urdf` in a cell file."""
