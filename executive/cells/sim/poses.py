"""Checks of a cell file: reach of bins, poses and safe place, clearance of poses, view of the cameras."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator

import cv2
import numpy as np

from executive.cell.arm import Goal
from executive.cell.clock import StepClock
from executive.cell.config import CellConfig
from executive.cell.layout import find_unreachable_places
from executive.cell.workcell import KeyPath
from executive.cells.sim.arm_occlusion import ArmOcclusion
from executive.cells.sim.camera import SimCamera, get_camera_pose
from executive.cells.sim.collision import ClearanceChecker
from executive.cells.sim.world import World
from executive.geometry import Array
from executive.motion.arms import build_kinematics, build_planner

POINTS_PER_SIDE = 9
"""Number of positions of the flattest object along each side of the workspace for the check of occlusion."""
MAX_GRID_SPACING = 0.02
"""Maximum spacing of the points at which partial views must show the workspace [m]."""


def find_places_out_of_reach(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each place or named pose of the cell file that the arm cannot reach.

    The tool must reach each slot of each bin and the safe place, from travel height down to the release
    height in one inverse kinematics branch. Each named pose must be within the joint limits.
    """
    planner = build_planner(config)

    def require_reachable(position: Array, floor_height: float) -> None:
        height = floor_height + config.max_object_height
        planner.require_reachable(Goal((float(position[0]), float(position[1]), height)))

    ranges = config.arm.limits.position_ranges_deg
    for name, pose in config.arm.poses_deg.items():
        for joint, (angle, (lower, upper)) in enumerate(zip(pose, ranges, strict=True), start=1):
            if not lower <= angle <= upper:
                limit = f"{upper:g}" if lower == -upper else f"{lower:g} to {upper:g}"
                message = f'joint {joint} of the pose "{name}" is at {angle:g} degrees; its limit is {limit}'
                yield ("arm", "poses_deg", name), message
    yield from find_unreachable_places(config, require_reachable)


def find_pose_errors(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each pose without clearance, and each pose or bin that occludes the table.

    In each named pose, arm and tool must keep the margin to table, bins and the arm itself, because otherwise
    no motion can end in the pose. From each scan pose, the camera must see the whole workspace; a camera with
    partial views must see it from all its scan poses together.
    """
    with contextlib.closing(ClearanceChecker(config)) as checker:
        for name, pose in config.arm.poses_deg.items():
            if violation := checker.find_violation(np.radians(pose)):
                margin = f"the minimum clearance is {config.motion.margin:.3f} m"
                message = f'the pose "{name}" brings {violation}; {margin}'
                yield ("arm", "poses_deg", name), message
        yield from _find_occluding_poses_and_bins(config, checker.world)


def _find_occluding_poses_and_bins(config: CellConfig, world: World) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each scan pose or bin that hides a part of the workspace from a camera."""
    occlusion = ArmOcclusion(world, build_kinematics(config), config, lambda: False)
    for name, camera_config in config.cameras.items():
        camera = SimCamera(world, name, camera_config, StepClock(lambda: 0.0), 0, occlusion=occlusion)
        if camera_config.partial_views:
            yield from _find_uncovered_areas(config, world, camera)
            continue
        for index, pose in _visit_scan_poses(config, world, camera):
            if not camera.sees_table():
                message = f'from the pose "{pose}" the camera {name} does not see the whole workspace: a '
                message += "part of it is outside of the image or behind the arm"
                yield ("cameras", name, "scan_poses", index), message
            elif bin := _find_occluding_bin(config, world, get_camera_pose(world, camera_config).position):
                message = f'the bin "{bin}" hides a part of the workspace from the camera {name} in the pose '
                yield ("bins", bin, "position"), message + f'"{pose}"; move or lower the bin'


def _find_uncovered_areas(
    config: CellConfig, world: World, camera: SimCamera
) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each scan pose that shows no area, and each area that no scan pose shows.

    A pose shows a point if the image contains a whole object at the point that neither arm nor bin hides.
    """
    sides = config.table.x, config.table.y
    xs, ys = (np.linspace(*side, 1 + math.ceil((side[1] - side[0]) / MAX_GRID_SPACING)) for side in sides)
    points = _list_object_centres(config, xs, ys)
    uncovered_mask = np.ones(len(points), dtype=bool)
    for index, pose in _visit_scan_poses(config, world, camera):
        frame = camera.capture()
        mask = frame.compute_area_mask(points, camera.get_view_box("full"))
        mask &= frame.compute_unoccluded_mask(points)
        bodies = _find_occluding_bodies(world, points, frame.X_WC.position)
        mask &= ~np.isin(bodies, list(world.bin_bodies.values()))
        if not mask.any():
            message = f'from the pose "{pose}" the camera {camera.name} sees no part of the workspace'
            yield ("cameras", camera.name, "scan_poses", index), message
        uncovered_mask &= ~mask
    image = uncovered_mask.reshape(len(xs), len(ys)).astype(np.uint8)
    for row in cv2.connectedComponentsWithStats(image)[2][1:]:
        y, x, width, height = row[:4]  # Rows of the image are positions along x.
        message = f"no scan pose of the camera {camera.name} shows the workspace from x {xs[x]:.2f} to "
        message += f"{xs[x + height - 1]:.2f} m and y {ys[y]:.2f} to {ys[y + width - 1]:.2f} m; add a pose, "
        yield ("cameras", camera.name, "scan_poses"), message + "or move the poses nearer to each other"


def _visit_scan_poses(config: CellConfig, world: World, camera: SimCamera) -> Iterator[tuple[int, str]]:
    """Move the arm to each scan pose of the cell file, and yield index and name of the pose."""
    for index, pose in enumerate(camera.scan_poses):
        if pose in config.arm.poses_deg:
            world.set_joint_positions(np.radians(config.arm.poses_deg[pose]))
            yield index, pose


def _list_object_centres(config: CellConfig, xs: Array, ys: Array) -> Array:
    """Return centres `(N, 3)` [m] of the flattest object at all pairs of coordinates, y changing fastest."""
    height = min(model.height for model in config.objects.values()) / 2
    return np.array([(x, y, height) for x in xs for y in ys])


def _find_occluding_bodies(world: World, points: Array, camera_position: Array) -> list[int]:
    """Return the body that hides each point `(N, 3)` [m] from the camera; -1 for none."""
    hits = world.client.rayTestBatch(points.tolist(), [tuple(camera_position)] * len(points))
    return [hit[0] for hit in hits]


def _find_occluding_bin(config: CellConfig, world: World, camera_position: Array) -> str | None:
    """Return a bin that occludes the centre of the flattest object somewhere in the workspace, or None."""
    xs, ys = (np.linspace(*side, POINTS_PER_SIDE) for side in (config.table.x, config.table.y))
    points = _list_object_centres(config, xs, ys)
    hit_bodies = {*_find_occluding_bodies(world, points, camera_position)}
    return next((name for name, body in world.bin_bodies.items() if body in hit_bodies), None)
