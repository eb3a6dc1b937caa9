"""Supported arms: the kinematics for each arm model that a cell file can name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from executive.cell.config import CellConfig
from executive.cell.workcell import KeyPath
from executive.motion.arm_model import Kinematics
from executive.motion.clearance_model import SAMPLING_MARGIN
from executive.motion.iiwa14_kinematics import IIWA14_JOINT_COUNT, Iiwa14
from executive.motion.limits import JointLimits, JointRange
from executive.motion.planner import Check, Planner

KinematicsFactory = Callable[[float, JointRange, float | None], Kinematics]
"""Builds kinematics from the tool length [m], the joint range, and the minimum distance between links [m]."""

ARMS: Mapping[str, tuple[int, KinematicsFactory]] = {"kuka_iiwa/model.urdf": (IIWA14_JOINT_COUNT, Iiwa14)}
"""Number of joints and kinematics of each supported arm, by the value of `arm.urdf` in a cell file."""


def find_unsupported_arm(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message if the arm of a cell file, or the number of its limits, is not supported."""
    if config.arm.urdf not in ARMS:
        yield (
            ("arm", "urdf"),
            f'the arm model "{config.arm.urdf}" has no kinematics; supported: {", ".join(sorted(ARMS))}',
        )
        return
    joint_count, _ = ARMS[config.arm.urdf]
    if config.arm.joint_count != joint_count:
        yield (
            ("arm", "limits"),
            f"the arm {config.arm.urdf} has {joint_count} joints, but the limits of {config.arm.joint_count} "
            f"joints are given; write {joint_count} values for each limit and pose",
        )


def build_kinematics(config: CellConfig, link_distance: float | None = None) -> Kinematics:
    """Return the kinematics of the arm of a cell file.

    `link_distance` is the minimum distance between links of the arm [m]; None: not limited.
    """
    _, build = ARMS[config.arm.urdf]
    return build(config.tool.length, JointLimits.of(config.arm.limits).position, link_distance)


def build_planner(config: CellConfig, check: Check | None = None) -> Planner:
    """Return the planner for the arm of a cell file; `check` as for `Planner`."""
    return Planner(config, build_kinematics(config, config.motion.margin + SAMPLING_MARGIN), check)
