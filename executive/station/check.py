"""Checks of a cell file that need the arm, the camera or the detectors, before a station is built."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import CellConfig, ObjectConfig
from executive.cell.devices import CameraImage, DriverKind, is_rehearsal, load_driver_kind
from executive.cell.frame import Box
from executive.errors import InputError
from executive.geometry import GRAVITY, Array, Pose
from executive.motion.joints import build_kinematics, find_arm_errors
from executive.motion.reach import find_braking_errors, find_places_out_of_reach
from executive.perception.camera_model import BORDER_FRACTION, compute_calibration, project
from executive.perception.detectors.detector_registry import find_detectable_labels, find_detector_errors
from executive.station.camera import CellCamera, Robot
from executive.text.validate import KeyPath

if TYPE_CHECKING:
    from executive.physics.cell_world import CellWorld


@dataclass(frozen=True)
class CellChecker:
    """Checks cell files of one kind; implements `executive.mission.cell_file.CellFileChecker`.

    Attributes:
        kind: Kind of the driver of the cells.
    """

    kind: DriverKind

    def check(self, config: CellConfig, cell_folder: Path) -> Iterator[tuple[KeyPath, str]]:
        """Yield key and message of each error that the validation of the cell file does not find.

        `cell_folder` is the folder of the cell file, to which paths in the file are relative.
        """
        if arm_errors := tuple(find_arm_errors(config)):
            yield from arm_errors
            return
        yield from self.kind.check(config, cell_folder)
        reach_errors = tuple(find_places_out_of_reach(config))
        yield from reach_errors
        if is_rehearsal(self.kind):
            yield from find_view_errors(config)
            return
        if not reach_errors:
            yield from find_braking_errors(config)
        yield from find_detector_errors(config.detectors, cell_folder)
        if config.localization == "ray" and not hasattr(self.kind, "cast_ray"):
            message = f'"ray" casts rays in a simulated world, which the driver "{config.kind}" does not have'
            yield ("localization",), f'{message}; write "plane" or "depth"'
        yield from find_pose_errors(config)

    def labels(self, config: CellConfig, cell_folder: Path) -> Mapping[str, tuple[str, ...] | None]:
        """Return the labels that each detector of a cell file can report, by name of the detector.

        The labels of a detector are None if they are unknown before its first answer. Errors in the file are
        ignored, because `check` reports errors.
        """
        if is_rehearsal(self.kind):
            return dict.fromkeys(config.detectors)
        return find_detectable_labels(config.detectors, cell_folder)

    def compute_mass(self, section: ObjectConfig) -> float:
        """Return the mass of the objects of a class [kg], 0 if it is unknown.

        Raises:
            InputError: The model of the class is invalid.
        """
        compute_mass = getattr(self.kind, "compute_mass", None)
        return float(compute_mass(section)) if compute_mass else section.mass or 0.0

    def measure_hold(self, config: CellConfig, label: str) -> float:
        """Return the largest force with which the tool can hold objects of a class [N], inf if unknown."""
        measure_hold = getattr(self.kind, "measure_hold", None)
        return float(measure_hold(config, label)) if measure_hold else math.inf


def load_checker(kind: str) -> CellChecker:
    """Return the checker of cell files with a value of the key `kind`.

    Raises:
        InputError: No package registers this kind, or its class cannot be loaded.
    """
    return CellChecker(load_driver_kind(kind))


POINTS_PER_SIDE = 9
"""Number of positions of the flattest object along each side of the workspace for the check of occlusion."""
DIFFERENTIATION_STEP = 1e-5
"""Step of a joint for the numerical derivative of the height of the tool [rad]."""
OPENING_COUNT = 8
"""Number of openings at which the model of a tool is compared with its section."""
MAX_FINGER_DISTANCE = 0.5
"""Maximum distance of a finger from the tool centre point [m]."""
MAX_FINGER_ERROR = 0.003
"""Maximum difference between the place of a finger in the model and in the section of the tool [m]."""
MAX_KINEMATICS_ERROR = 1e-4
"""Maximum difference between the kinematics of the solver and of the model, in position [m] and rotation."""


def find_pose_errors(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each pose without clearance, and each pose or bin that occludes the table.

    In each named pose, arm and tool must keep the margin to table, bins and the arm itself, because otherwise
    no motion can end in the pose. From each scan pose, the camera must see the whole workspace; a camera with
    partial views must see it from all its scan poses together. If the model of the arm is invalid, only its
    errors are reported.
    """
    # The import loads PyBullet, which takes 0.2 s; a cell without physics does not need it.
    from executive.physics.arm_model import find_arm_model_errors
    from executive.physics.cell_world import LINK_A
    from executive.physics.collision import ClearanceChecker

    if model_errors := tuple(find_arm_model_errors(config.arm)):
        yield from model_errors
        return
    try:
        config.tool.compute_joint_positions(0.0)
        checker = ClearanceChecker(config)
    except InputError as error_of_tool:
        yield ("tool", "model"), str(error_of_tool)
        return
    with contextlib.closing(checker):
        yield from _find_wrong_openings(config, checker.world)
        if error := _describe_wrong_solver(config, checker.world):
            yield ("arm", "solver"), error
            return
        for name, pose in config.arm.poses_deg.items():
            if violation := checker.find_violation(np.radians(pose)):
                margin = f"the minimum clearance is {config.motion.margin:.3f} m"
                message = f'the pose "{name}" brings {violation}; {margin}'
                yield ("arm", "poses_deg", name), message
        yield from find_payload_errors(config, checker.world, config.arm.poses_deg)
        for name, body in checker.world.bin_bodies.items():
            # No motion can change this, so that the check of motions leaves it out.
            points = checker.world.client.getClosestPoints(checker.world.arm, body, 0.0)
            if any(checker.world.joint_counts[point[LINK_A]] == 0 for point in points):
                yield ("arm", "base"), f'the base of the arm stands in the bin "{name}"; move one of them'
        yield from _find_occluding_poses_and_bins(config, checker.world)


def _find_wrong_openings(config: CellConfig, world: CellWorld) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message if fingers are elsewhere than at the distance that their tool section declares.

    Two rays measure the distance, from the tool centre point along the y axis of the tool in both directions.
    """
    max_opening = config.tool.max_opening
    if not max_opening:
        return
    X_WT = world.get_tool_pose()
    start = X_WT.position.tolist()
    ends = X_WT.apply(np.array([[0.0, -MAX_FINGER_DISTANCE, 0.0], [0.0, MAX_FINGER_DISTANCE, 0.0]])).tolist()
    for opening in np.linspace(max_opening, config.tool.min_opening, OPENING_COUNT + 1)[:-1].tolist():
        world.set_opening(opening)
        hits = world.client.rayTestBatch([start, start], ends)
        distances = [hit[2] * MAX_FINGER_DISTANCE for hit in hits]
        if max(abs(each - opening / 2) for each in distances) > MAX_FINGER_ERROR:
            places = " and ".join(
                f"{each * 1000:.0f} mm" if each < MAX_FINGER_DISTANCE else "nothing" for each in distances
            )
            message = f"with {opening * 1000:.0f} mm between its fingers, the model has {places} beside"
            yield ("tool", "model"), f"{message} the tool centre point along y, not {opening * 500:.0f} mm"
            return


def find_payload_errors(
    config: CellConfig, world: CellWorld, poses_deg: Mapping[str, Sequence[float]]
) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each pose in which a joint cannot hold arm, tool and the heaviest class.

    The torque of each joint is that of the weight of all links, of the tool, and of an object at the tool.
    """
    kinematics = build_kinematics(config)
    checker = load_checker(config.kind)
    mass = 0.0
    for section in config.objects.values():
        with contextlib.suppress(InputError):  # The driver reports an invalid model.
            mass = max(mass, checker.compute_mass(section))
    efforts = np.array(config.arm.effort)
    for name, pose in poses_deg.items():
        q = np.radians(pose)
        # The joints of the tool come after those of the arm.
        still = [0.0] * (len(pose) + len(world.tool_joints))
        positions = [*q.tolist(), *still[len(pose) :]]
        torques = np.array(world.client.calculateInverseDynamics(world.arm, positions, still, still))
        torques = torques[: len(pose)]
        steps = q + DIFFERENTIATION_STEP * np.eye(len(q))
        heights = kinematics.compute_tcps_and_axes(np.vstack([q, steps]))[0][:, 2]
        torques += mass * GRAVITY * (heights[1:] - heights[0]) / DIFFERENTIATION_STEP
        joint = int(np.argmax(np.abs(torques) / efforts))
        if abs(torques[joint]) > efforts[joint]:
            needed = f"joint {joint + 1} needs {abs(torques[joint]):.1f} Nm to hold arm, tool and {mass:g} kg"
            message = f'{needed} in the pose "{name}"; its effort is {efforts[joint]:g} Nm'
            yield ("arm", "poses_deg", name), message


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


class StillRobot:
    """An arm that stands in a pose, an empty tool, and a camera with black images."""

    holding = False

    def __init__(self, config: CellConfig) -> None:
        self.q = np.zeros(config.arm.joint_count)
        camera = next(iter(config.cameras.values()))
        self._image = np.zeros((camera.height, camera.width, 3), np.uint8)

    def capture(self) -> CameraImage:
        """Return a black image."""
        return CameraImage(self._image, None, 0.0)


def _find_occluding_poses_and_bins(config: CellConfig, world: CellWorld) -> Iterator[tuple[KeyPath, str]]:
    robot: Any = StillRobot(config)
    name = next(iter(config.cameras))
    build = build_kinematics(config)
    camera = CellCamera(config, robot, Robot(robot, robot), Robot(robot, robot), build)

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
