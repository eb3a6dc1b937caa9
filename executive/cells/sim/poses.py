"""Checks of places and poses of a cell file: reach, clearance and view of the cameras."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import numpy as np

from executive.cell.arm import Goal
from executive.cell.clock import StepClock
from executive.cell.config import CellConfig
from executive.cell.layout import find_unreachable_places
from executive.cell.workcell import KeyPath
from executive.cells.sim.arm import SimArm
from executive.cells.sim.camera import camera_pose
from executive.cells.sim.collision import PathClearance
from executive.cells.sim.view import ArmShadow
from executive.cells.sim.world import World
from executive.geometry import Array
from executive.motion.arms import build_planner
from executive.perception.camera_model import compute_calibration

POINTS_PER_SIDE = 9
"""Number of places along each side of the workspace where every camera must see an object."""


def find_places_out_of_reach(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and sentence for each place of the cell file that the tool cannot reach.

    The tool must reach each drop slot of each bin and the safe place, from travel height down to the release
    height in one posture; each named pose must be within the joint limits.
    """
    planner = build_planner(config)
    load = max(kind.height for kind in config.objects.values())

    def require(place: Array, floor: float) -> None:
        planner.require_reachable(Goal((float(place[0]), float(place[1]), floor + load)))

    ranges = config.arm.limits.position_ranges_deg
    for name, pose in config.arm.poses_deg.items():
        for joint, (angle, (lower, upper)) in enumerate(zip(pose, ranges, strict=True), start=1):
            if not lower <= angle <= upper:
                limit = f"{upper:g}" if lower == -upper else f"{lower:g} to {upper:g}"
                yield (
                    ("arm", "poses_deg", name),
                    f'joint {joint} of the pose "{name}" is at {angle:g} degrees; its limit is {limit}',
                )
    yield from find_unreachable_places(config, require)


def find_unfit_poses(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and sentence for each pose of the cell file without clearance or view.

    In each named pose, arm and tool must keep the margin to table, bins and the arm itself, because otherwise
    no motion reaches the pose. From each scan pose the camera must see the whole workspace.
    """
    with contextlib.closing(PathClearance(config)) as clearance:
        for name, pose in config.arm.poses_deg.items():
            near = clearance.find_violation(np.radians(pose))
            if near:
                yield (
                    ("arm", "poses_deg", name),
                    f'the pose "{name}" brings {near}; {config.motion.margin:.3f} m must stay free',
                )
        yield from _find_blind_poses(config, clearance.world)


def _find_blind_poses(config: CellConfig, world: World) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and sentence for scan poses and bins that hide a part of the workspace from a camera."""
    planner = build_planner(config)
    shadow = ArmShadow(SimArm(world, planner, config, StepClock(lambda: 0.0)), planner.kinematics, config)
    for name, camera in config.cameras.items():
        matrix, _ = compute_calibration(camera)
        for index, pose in enumerate(camera.scan_poses):
            if pose not in config.arm.poses_deg:
                continue
            world.set_arm(np.radians(config.arm.poses_deg[pose]))
            if not shadow.sees_table(matrix, camera_pose(world, camera), (camera.width, camera.height)):
                yield (
                    ("cameras", name, "scan_poses", index),
                    f'from the pose "{pose}" the camera {name} does not see the whole workspace: a part '
                    "of it is outside of the image or behind the arm",
                )
            elif bin := _find_hiding_bin(config, world, camera_pose(world, camera).position):
                yield (
                    ("bins", bin, "position"),
                    f'the bin "{bin}" hides a part of the workspace from the camera {name} in the pose '
                    f'"{pose}"; move or lower the bin',
                )


def _find_hiding_bin(config: CellConfig, world: World, camera: Array) -> str | None:
    """Return the name of a bin that hides the centre of the flattest object in the workspace, or None."""
    xs, ys = (np.linspace(*side, POINTS_PER_SIDE) for side in (config.table.x, config.table.y))
    height = min(kind.height for kind in config.objects.values()) / 2
    points = [(x, y, height) for x in xs for y in ys]
    hit = {ray[0] for ray in world.client.rayTestBatch(points, [tuple(camera)] * len(points))}
    return next((name for name, bodies in world.bins.items() if hit.intersection(bodies)), None)
