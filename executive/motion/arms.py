"""Supported arms: kinematics for each arm model that a cell file can name, and the check of its reach."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from executive.cell.arm import Goal
from executive.cell.config import CellConfig
from executive.cell.workcell import KeyPath
from executive.errors import Unreachable
from executive.motion.clearance_model import SAMPLING_MARGIN
from executive.motion.iiwa14_kinematics import IIWA14_JOINT_COUNT, Iiwa14
from executive.motion.joints import JointLimits, JointRange, Kinematics
from executive.motion.planner import CollisionCheck, Planner

KinematicsFactory = Callable[[float, JointRange, float | None], Kinematics]
"""Function that builds kinematics from tool length [m], joint range, and minimum link distance [m]."""

ARMS_BY_URDF: Mapping[str, tuple[int, KinematicsFactory]] = {
    "kuka_iiwa/model.urdf": (IIWA14_JOINT_COUNT, Iiwa14)
}
"""Number of joints and kinematics of each supported arm, by the key `arm.urdf` of cell files."""


def find_arm_errors(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield the key and the message of each error: unsupported arm, or wrong number of joints."""
    if config.arm.urdf not in ARMS_BY_URDF:
        supported_arms = ", ".join(sorted(ARMS_BY_URDF))
        message = f'the arm model "{config.arm.urdf}" has no kinematics; supported: {supported_arms}'
        yield ("arm", "urdf"), message
        return
    joint_count, _ = ARMS_BY_URDF[config.arm.urdf]
    if config.arm.joint_count != joint_count:
        yield (
            ("arm", "limits"),
            f"the arm {config.arm.urdf} has {joint_count} joints, but the limits of {config.arm.joint_count} "
            f"joints are given; write {joint_count} values for each limit and pose",
        )


def build_kinematics(config: CellConfig, min_link_distance: float | None = None) -> Kinematics:
    """Return the kinematics of the arm of a cell file, with a minimum distance [m] between its links."""
    _, factory = ARMS_BY_URDF[config.arm.urdf]
    joint_range = JointLimits.from_config(config.arm.limits).position
    return factory(config.tool.length, joint_range, min_link_distance)


def build_planner(config: CellConfig, check_collision: CollisionCheck | None = None) -> Planner:
    """Return the planner for the arm of a cell file, optionally with an additional collision check."""
    kinematics = build_kinematics(config, config.motion.margin + SAMPLING_MARGIN)
    return Planner(config, kinematics, check_collision)


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
    safe_x, safe_y, safe_z = config.safe_place
    places: list[tuple[KeyPath, str, list[list[float]], float]] = [
        (("bins", name, "position"), f'the bin "{name}"', bin.slots.tolist(), float(bin.position[2]))
        for name, bin in config.build_bins().items()
    ]
    places.append((("safe_place",), "the safe place", [[safe_x, safe_y]], safe_z))
    planner = build_planner(config)
    for key_path, place_name, positions, surface_height in places:
        try:
            for x, y in positions:
                planner.require_reachable(Goal((x, y, surface_height + config.max_object_height)))
        except Unreachable as error:
            yield key_path, f"{place_name} is out of reach: {error}"
