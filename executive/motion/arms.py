"""Supported arms: kinematics for each arm model that a cell file can name, and the check of its reach."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from executive.cell.arm import Goal
from executive.cell.config import CellConfig
from executive.errors import Unreachable
from executive.geometry import Array
from executive.motion.configurations import find_configuration_pairs
from executive.motion.iiwa14_kinematics import IIWA14_JOINT_COUNT, Iiwa14
from executive.motion.joints import JointLimits, JointRange, Kinematics
from executive.text.validate import KeyPath

KinematicsFactory = Callable[[float, JointRange, float | None], Kinematics]
"""Function that builds kinematics from tool length [m], joint range, and minimum link distance [m]."""

ARMS_BY_URDF: Mapping[str, tuple[int, KinematicsFactory]] = {
    "kuka_iiwa/model.urdf": (IIWA14_JOINT_COUNT, Iiwa14)
}
"""Number of joints and kinematics of each supported arm, by the key `arm.urdf` of cell files."""
SAMPLING_MARGIN = 0.001
"""Addition to the margin of the cell, because only samples of a motion are checked [m]."""


def find_arm_errors(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield the key and the message of each error: unsupported arm, or wrong number of joints."""
    if config.arm.urdf not in ARMS_BY_URDF:
        supported_arms = ", ".join(sorted(ARMS_BY_URDF))
        message = f'the arm model "{config.arm.urdf}" has no kinematics; supported: {supported_arms}'
        yield ("arm", "urdf"), message
        return
    joint_count, _ = ARMS_BY_URDF[config.arm.urdf]
    if config.arm.joint_count != joint_count:
        message = (
            f"the arm {config.arm.urdf} has {joint_count} joints, but the limits of {config.arm.joint_count} "
            f"joints are given; write {joint_count} values for each limit and pose"
        )
        yield ("arm", "limits"), message


def build_kinematics(config: CellConfig, min_link_distance: float | None = None) -> Kinematics:
    """Return the kinematics of the arm of a cell file, with a minimum distance [m] between its links."""
    _, factory = ARMS_BY_URDF[config.arm.urdf]
    joint_range = JointLimits.from_config(config.arm.limits).position
    return factory(config.tool.length, joint_range, min_link_distance)


def build_planning_kinematics(config: CellConfig) -> Kinematics:
    """Return the kinematics of the arm of a cell file, whose links keep the margin of planned motions."""
    return build_kinematics(config, config.motion.margin + SAMPLING_MARGIN)


def find_places_out_of_reach(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each place or named pose of the cell file that the arm cannot reach.

    The tool must reach each slot of each bin and the safe place, from travel height down to the release
    height in one inverse kinematics branch. Each named pose must be within the joint limits.
    """
    ranges = config.arm.limits.position_ranges_deg
    for name, pose in config.arm.poses_deg.items():
        for joint, (angle, (lower, upper)) in enumerate(zip(pose, ranges, strict=True), start=1):
            if not lower <= angle <= upper:
                limit = f"{upper:g}" if lower == -upper else f"{lower:g} to {upper:g}"
                message = f'joint {joint} of the pose "{name}" is at {angle:g} degrees; its limit is {limit}'
                yield ("arm", "poses_deg", name), message
    kinematics = build_planning_kinematics(config)
    q_start = np.zeros(config.arm.joint_count)
    places: list[tuple[KeyPath, str, Array, float]] = [
        (("bins", name, "position"), f'the bin "{name}"', bin.build_bin(name).slots, bin.position[2])
        for name, bin in config.bins.items()
    ]
    safe_position = np.array([config.safe_place[:2]])
    places.append((("safe_place",), "the safe place", safe_position, config.safe_place[2]))
    for key_path, place_name, positions, surface_height in places:
        height = surface_height + config.max_hold_height
        approach_height = max(0.0, config.travel_height - height)
        try:
            for x, y in positions.tolist():
                find_configuration_pairs(kinematics, Goal((x, y, height)), approach_height, q_start)
        except Unreachable as error:
            yield key_path, f"{place_name} is out of reach: {error}"
