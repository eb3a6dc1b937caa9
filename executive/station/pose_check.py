"""Check of the named poses of an arm: clearance, and the view of the camera past arm and bins."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import CellConfig
from executive.cell.devices import CameraImage
from executive.geometry import Array
from executive.motion.joints import build_kinematics
from executive.physics.cell_world import CellWorld
from executive.physics.collision import ClearanceChecker
from executive.station.camera import CellCamera, Robot
from executive.station.view_check import find_view_errors
from executive.text.validate import KeyPath

POINTS_PER_SIDE = 9
"""Number of positions of the flattest object along each side of the workspace for the check of occlusion."""


MAX_KINEMATICS_ERROR = 1e-4
"""Maximum difference between the kinematics of the solver and of the model, in position [m] and rotation."""


def find_pose_errors(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each pose without clearance, and each pose or bin that occludes the table.

    In each named pose, arm and tool must keep the margin to table, bins and the arm itself, because otherwise
    no motion can end in the pose. From each scan pose, the camera must see the whole workspace; a camera with
    partial views must see it from all its scan poses together.
    """
    with contextlib.closing(ClearanceChecker(config)) as checker:
        if error := _describe_wrong_solver(config, checker.world):
            yield ("arm", "solver"), error
            return
        for name, pose in config.arm.poses_deg.items():
            if violation := checker.find_violation(np.radians(pose)):
                margin = f"the minimum clearance is {config.motion.margin:.3f} m"
                message = f'the pose "{name}" brings {violation}; {margin}'
                yield ("arm", "poses_deg", name), message
        yield from _find_occluding_poses_and_bins(config, checker.world)


def _describe_wrong_solver(config: CellConfig, world: CellWorld) -> str:
    """Return a message if the kinematics of the solver differ from the model of the arm, or ""."""
    lower, upper = np.radians(config.arm.limits.position_ranges_deg).T
    q = lower + 0.7 * (upper - lower)  # No joint is at 0, so that the axis of each joint matters.
    world.set_joint_positions(q)
    difference = world.get_tool_pose().inverse() @ build_kinematics(config).compute_tool_pose(q)
    distance = float(np.linalg.norm(difference.position))
    if max(distance, np.abs(difference.rotation - np.eye(3)).max()) < MAX_KINEMATICS_ERROR:
        return ""
    return (
        f'the solver "{config.arm.solver}" does not describe the model {config.arm.urdf}: its tool is '
        f"{distance:.3f} m away from the tool of the model, or turned; correct urdf, flange or solver"
    )


class _StillRobot:
    """An arm that stands in a pose, an empty tool, and a camera with black images."""

    holding = False

    def __init__(self, config: CellConfig) -> None:
        self.q = np.zeros(config.arm.joint_count)
        camera = next(iter(config.cameras.values()))
        self._image = np.zeros((camera.height, camera.width, 3), np.uint8)

    def capture(self) -> CameraImage:
        return CameraImage(self._image, None, 0.0)


def _find_occluding_poses_and_bins(config: CellConfig, world: CellWorld) -> Iterator[tuple[KeyPath, str]]:
    robot: Any = _StillRobot(config)
    name = next(iter(config.cameras))
    build = build_kinematics(config)
    camera = CellCamera(config, name, robot, Robot(robot, robot), Robot(robot, robot), build)

    def move_to(pose: str) -> None:
        robot.q = np.radians(config.arm.poses_deg[pose])
        world.set_joint_positions(robot.q)

    def find_hidden(pose: str, points: Array) -> NDArray[np.bool_]:
        """Return the mask `(N,)` of the points `(N, 3)` [m] at which arm or bins hide an object."""
        move_to(pose)
        frame = camera.capture()
        min_height = min(model.height for model in config.objects.values())
        centres = points + np.array([0.0, 0.0, min_height / 2])
        bodies = _find_occluding_bodies(world, centres, frame.X_WC.position)
        return ~frame.compute_unoccluded_mask(centres) | np.isin(bodies, list(world.bin_bodies.values()))

    view_errors = list(find_view_errors(config, find_hidden))
    yield from view_errors
    if view_errors or camera.config.partial_views:
        return
    for index, pose in enumerate(camera.scan_poses):
        if pose not in config.arm.poses_deg:
            continue
        move_to(pose)
        if not camera.sees_table():
            message = f'in the pose "{pose}" the arm hides a part of the workspace from the camera {name}'
            yield ("cameras", name, "scan_poses", index), message
        elif bin := _find_occluding_bin(config, world, camera.capture().X_WC.position):
            yield (
                ("bins", bin, "position"),
                f'the bin "{bin}" hides a part of the workspace from the camera {name} in the pose "{pose}"; '
                "move or lower the bin",
            )


def _find_occluding_bodies(world: CellWorld, points: Array, camera_position: Array) -> list[int]:
    """Return the body that hides each point `(N, 3)` [m] from the camera; -1 for none."""
    hits = world.client.rayTestBatch(points.tolist(), [tuple(camera_position)] * len(points))
    return [hit[0] for hit in hits]


def _find_occluding_bin(config: CellConfig, world: CellWorld, camera_position: Array) -> str | None:
    """Return a bin that occludes the centre of the flattest object somewhere in the workspace, or None."""
    xs, ys = (np.linspace(*side, POINTS_PER_SIDE) for side in (config.table.x, config.table.y))
    height = min(model.height for model in config.objects.values()) / 2
    points = np.array([(x, y, height) for x in xs for y in ys])
    hit_bodies = {*_find_occluding_bodies(world, points, camera_position)}
    return next((name for name, body in world.bin_bodies.items() if body in hit_bodies), None)
