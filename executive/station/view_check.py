"""Check that the image and the table view of a camera show the workspace from the scan poses."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import CellConfig
from executive.cell.frame import Box
from executive.geometry import Array, Pose
from executive.motion.joints import build_kinematics
from executive.perception.camera_model import BORDER_FRACTION, compute_calibration, project
from executive.text.validate import KeyPath

MAX_GRID_SPACING = 0.02
"""Maximum spacing of the points at which the views must show the workspace [m]."""
MIN_OBJECT_DIAMETER = 6.0
"""Minimum diameter of the smallest class in the image [pixel]; detectors overlook smaller objects."""

Mask = NDArray[np.bool_]
"""Mask `(N,)` of points, or `(P, N)` for `P` camera poses."""


def find_view_errors(
    config: CellConfig, find_hidden: Callable[[str, Array], Mask] = lambda _, points: points[:, 2] > 0
) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each scan pose from which the camera does not show the workspace.

    Image and table view must show the workspace, from the table top to the height of the highest class. With
    partial views, all images together must show it, because missions search images instead of table views.

    Args:
        config: The cell file.
        find_hidden: Returns the mask of the points `(N, 3)` [m] on the table that arm and bins hide from a
            camera with partial views in a scan pose; by default none.
    """
    sides = config.table.x, config.table.y
    xs, ys = (np.linspace(*side, 1 + math.ceil((side[1] - side[0]) / MAX_GRID_SPACING)) for side in sides)
    points = np.array([(x, y, 0.0) for x in xs for y in ys])
    volume = np.array([points, points + np.array([0.0, 0.0, config.max_object_height])])
    name, camera = next(iter(config.cameras.items()))
    matrix, X_MC = compute_calibration(camera)
    poses = [pose for pose in camera.scan_poses if pose in config.arm.poses_deg]
    if not poses:
        return  # `read_cell` reports unknown poses.
    key = "calibration" if camera.calibration else "position"
    mounts = [Pose.identity()]
    if camera.mount == "wrist":
        key = "scan_poses"
        kinematics = build_kinematics(config)
        X_TF = Pose.of([0.0, 0.0, -config.tool.length])
        qs = np.radians([config.arm.poses_deg[pose] for pose in poses])
        mounts = [kinematics.compute_tool_pose(q) @ X_TF for q in qs]

    def find_shown(region: Box, X_MC: Pose) -> Mask:
        return np.array([_find_shown(volume, matrix, X_WM @ X_MC, region) for X_WM in mounts])

    border = round(BORDER_FRACTION * camera.height) if camera.partial_views else 0
    image = border, border, camera.width - border, camera.height - border
    image_masks = find_shown(image, X_MC)
    view_masks = find_shown(camera.table_view, X_MC)
    if camera.partial_views:
        hidden_masks = np.array([find_hidden(pose, points) for pose in poses])
        image_masks = (image_masks & ~hidden_masks).any(axis=0, keepdims=True)
    advice = "correct the pose and focal length of the camera, the scan poses, or the view"
    if camera.calibration and find_shown(camera.table_view, X_MC.inverse()).all():
        advice = "the inverse transformation would: exchange mount_to_camera and camera_to_mount"
    for index, mask in enumerate(image_masks):
        if not mask.all():
            place = f' from the pose "{poses[index]}"' if len(image_masks) > 1 else ""
            gap = _describe_gap(points, mask)
            message = f"the image of the camera {name}{place} does not show {gap}; {advice}"
            yield ("cameras", name, key, *([camera.scan_poses.index(poses[index])] if place else [])), message
    if not image_masks.all():
        return
    depth = (mounts[0] @ X_MC).inverse().apply(points.mean(axis=0))[2]
    min_radius = min(section.radius for section in config.objects.values())
    if (diameter := 2 * min_radius * matrix.diagonal()[:2].min() / depth) < MIN_OBJECT_DIAMETER:
        message = (
            f"the camera {name} shows the smallest class with {diameter:.1f} pixels instead of "
            f"{MIN_OBJECT_DIAMETER:g}; correct the focal length or the distance of the camera"
        )
        yield ("cameras", name, "calibration" if camera.calibration else "fov_deg"), message
    for mask in view_masks:
        if not (mask.any() if camera.partial_views else mask.all()):
            pixels = np.array([project(matrix, X_WM @ X_MC, volume) for X_WM in mounts])
            low = np.floor(pixels.min(axis=(0, 1, 2)))
            high = np.ceil(pixels.max(axis=(0, 1, 2)))
            side = (high - low).max()
            corner = np.clip((low + high - side) // 2, 0, (camera.width - side, camera.height - side))
            if corner.min() >= 0 and "inverse" not in advice and not camera.partial_views:
                advice = f"the smallest sufficient view is {[*map(int, (*corner, *(corner + side)))]}"
            message = (
                f"the table_view of the camera {name} does not show {_describe_gap(points, mask)}; {advice}"
            )
            yield ("cameras", name, "table_view"), message
            return


def _find_shown(volume: Array, matrix: Array, X_WC: Pose, region: Box) -> Mask:
    """Return the mask `(N,)` of the places on the table that a region of an image shows.

    `volume` `(2, N, 3)` [m] contains for each place a point on the table and a point above it.
    """
    x, y, depth = np.moveaxis(X_WC.inverse().apply(volume) @ matrix.T, -1, 0)
    left, top, right, bottom = region
    is_inside = (left * depth <= x) & (x <= right * depth) & (top * depth <= y) & (y <= bottom * depth)
    # No point behind the camera is inside, because a negative depth exchanges the borders.
    is_visible = is_inside & (volume[..., 2] < X_WC.position[2])
    return np.asarray(is_visible.all(axis=0))


def _describe_gap(points: Array, mask: Mask) -> str:
    """Return fraction and region of the workspace points `(N, 3)` [m] that are not in a mask `(N,)`."""
    x_min, y_min, _ = points[~mask].min(axis=0)
    x_max, y_max, _ = points[~mask].max(axis=0)
    region = f"x {x_min:.2f} to {x_max:.2f} m and y {y_min:.2f} to {y_max:.2f} m"
    return f"{1 - mask.mean():.0%} of the workspace, from {region}"
