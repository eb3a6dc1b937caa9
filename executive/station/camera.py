"""The camera as skills see it: frames with the pose of the camera, and the pixels that the arm hides."""

from __future__ import annotations

import base64
import itertools
import math
import zlib
from collections.abc import Callable, Collection
from typing import TYPE_CHECKING, Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell.config import CellConfig
from executive.cell.devices import ArmDevice, CameraDevice, CameraImage
from executive.cell.frame import BinAppearance, Box, Detections, Frame, Region, TrueFrame
from executive.cell.objects import Obstacle
from executive.cell.protocols import Tool
from executive.errors import WrongImage
from executive.geometry import Array, Pose
from executive.motion.joints import Kinematics
from executive.perception.bin_check import inspect_bins
from executive.perception.camera_check import describe_displacement, describe_standstill
from executive.perception.camera_model import (
    BORDER_FRACTION,
    compute_calibration,
    compute_hull_mask,
    draw_hull,
)
from executive.perception.witness import find_unexplained

if TYPE_CHECKING:
    from executive.physics.arm_model import ArmHulls

MAX_PIXELS = 10**8
"""Maximum number of pixels of a recorded image."""
MAX_LOAD_OFFSET = 0.015
"""Maximum distance of the centre of a held object from the axis of the tool [m]."""
TOOL_SPHERE_RADIUS = 0.02
"""Radius of the spheres that enclose the tool with its cables and hoses [m]."""
SPHERES_PER_SEGMENT = 9
"""Number of spheres that cover the segment between two points on the axis of a part of the arm."""


def _load_hulls(config: CellConfig) -> ArmHulls:
    # The import loads PyBullet in 0.2 s; a cell without physics does not need it.
    from executive.physics.arm_model import ArmHulls

    return ArmHulls(config.arm)


class Robot(NamedTuple):
    """An arm and the tool at its flange."""

    arm: ArmDevice
    tool: Tool


class CellCamera:
    """The first camera of a cell, with frames numbered from 1; implements `executive.cell.protocols.Camera`.

    Args:
        config: The cell file.
        device: The camera of the driver.
        robot: The arm, whose flange is the mount of a wrist camera, and the tool. An object that the tool
            holds is assumed to be of the largest class.
        unrecorded_robot: The same arm and tool, whose reads are not recorded, for `sees_table`: the answer
            itself is recorded.
        kinematics: Kinematics of the arm.
        get_change_count: Returns the number of changes of the objects on the table so far.
        is_hidden_by_arm: False if the arm hides nothing, as in a cell without physics.

    Attributes:
        name: Name of the camera in the cell file.
        config: Section of the camera in the cell file.
        matrix: Camera matrix `(3, 3)` [pixel].
        scan_poses: Names of the arm poses from which the camera sees the table; the first has the best view.
    """

    def __init__(
        self,
        config: CellConfig,
        device: CameraDevice,
        robot: Robot,
        unrecorded_robot: Robot,
        kinematics: Kinematics,
        *,
        get_change_count: Callable[[], int] = lambda: 0,
        is_hidden_by_arm: bool = True,
    ) -> None:
        self.name, self.config = next(iter(config.cameras.items()))
        self.scan_poses = self.config.scan_poses
        self.matrix, self._X_MC = compute_calibration(self.config)
        self._device = device
        self._robot = robot
        self._unrecorded_robot = unrecorded_robot
        self._kinematics = kinematics
        self._bins = tuple(config.build_bins().values())
        self._get_change_count = get_change_count
        self._is_hidden_by_arm = is_hidden_by_arm
        # T is the frame of the tool, F the frame of the flange.
        self._X_TF = Pose.of((0.0, 0.0, -config.tool.length))
        self._size = (self.config.width, self.config.height)
        self._hulls = _load_hulls(config) if is_hidden_by_arm else None
        self._tool_corners: list[Array] = []
        """Corners `(N, 3)` of the palm, and of both fingers, in the frame of the tool [m]."""
        if opening := config.tool.max_opening:
            palm, *fingers = (part.list_corners() for part in config.tool.list_parts(opening))
            self._tool_corners = [palm, np.concatenate(fingers)]
        self._load_radius = max(section.radius for section in config.objects.values()) + MAX_LOAD_OFFSET
        self._load_height = config.max_hold_height
        heights = (0.0, config.max_pile_height)
        self._workspace_corners = np.array(list(itertools.product(config.table.x, config.table.y, heights)))
        self._cell_config = config
        self._frame_count = 0
        self._last_frame: Frame | None = None
        """Last frame that was compared with the frame before."""
        self._last_time = 0.0
        """Time of its capture on the clock of the run [s]."""
        self._pose_count = 0
        self._content_mask = np.ones((self.config.height, self.config.width), dtype=bool)
        """Mask `(H, W)` of the pixels that are not in the ignored border of an image with a partial view."""
        if self.config.partial_views:
            width = round(BORDER_FRACTION * self.config.height)
            self._content_mask = np.pad(self._content_mask[width:-width, width:-width], width)

    def next_pose(self) -> str:
        """Advance to the next scan pose, and return its name."""
        self._pose_count += 1
        return self.scan_poses[self._pose_count % len(self.scan_poses)]

    def get_view_box(self, view: str) -> Box:
        """Return the region of a view."""
        return self.config.get_view_box(view)

    def sees_table(self) -> bool:
        """Return True if the workspace, up to the height of a pile, is in the image and not occluded."""
        robot = self._unrecorded_robot
        X_WC = self._compute_pose(robot.arm.q)
        mask = compute_hull_mask(self._workspace_corners, self.matrix, X_WC, self._size)
        return bool(mask.any() and np.all(self._compute_visibility_mask(robot, X_WC)[mask]))

    def capture(self) -> Frame:
        """Capture an image, and return the frame."""
        self._frame_count += 1
        X_WC = self._compute_pose(self._robot.arm.q)
        image = self._device.capture()
        height, width = image.colour.shape[:2]
        if (width, height) != self._size:
            sizes = f"{width} x {height} pixels instead of {self._size[0]} x {self._size[1]}"
            raise WrongImage(f"camera {self.name} returned an image of {sizes}, which the cell file declares")
        visible = image.visible
        if visible is None:
            visible = self._compute_visibility_mask(self._robot, X_WC)
        frame = Frame(
            id=self._frame_count,
            camera=self.name,
            image=image.colour,
            depth=image.depth,
            matrix=self.matrix,
            X_WC=X_WC,
            stamp=image.stamp,
            visible=visible & self._content_mask,
            change_count=self._get_change_count(),
        )
        if image.true_detections is None:
            return frame
        return TrueFrame(**vars(frame), true_detections=image.true_detections)

    def find_faults(self, frame: Frame, time: float) -> dict[str, str]:
        """Return the first fault that a frame captured at a time [s] shows, by its reason."""
        if standstill := self._describe_standstill(frame, time):
            return {"frozen": standstill}
        displacement = describe_displacement(frame, self._bins) if self._is_hidden_by_arm else ""
        return {"camera_moved": displacement} if displacement else {}

    def _describe_standstill(self, frame: Frame, time: float) -> str:
        last_frame = self._last_frame or frame
        last_time = self._last_time
        self._last_frame = frame
        self._last_time = time
        if time > last_time and frame is not last_frame and frame.stamp <= last_frame.stamp:
            stamps = f"the stamp {frame.stamp:.3f} s, and frame {last_frame.id} had {last_frame.stamp:.3f} s"
            return f"the clock of camera {self.name} stands: frame {frame.id} has {stamps}"
        has_noise = self._is_hidden_by_arm and self.config.noise.read > 0
        # A test may replace images by black ones with true detections.
        is_blank = isinstance(frame, TrueFrame) and not frame.image.any()
        if not has_noise or is_blank or frame is last_frame:
            return ""
        return describe_standstill(frame, last_frame)

    def find_unexplained(self, look: Detections, obstacles: Collection[Obstacle]) -> list[Region]:
        """Return the regions of a frame that no detection and no obstacle explains; none without physics."""
        if not self._is_hidden_by_arm:
            return []
        boxes = [detection.box for detection in look.unknown]
        return find_unexplained(look.frame, boxes, self._cell_config, obstacles)

    def inspect_bins(self, frame: Frame) -> dict[str, BinAppearance]:
        """Return what a frame shows of the bins in view; nothing without physics."""
        return inspect_bins(frame, self._bins) if self._is_hidden_by_arm else {}

    def _compute_pose(self, q: Array) -> Pose:
        """Return the pose `X_WC` of the camera at joint positions `q` `(n,)` [rad]."""
        if self.config.mount == "fixed":
            return self._X_MC
        return self._kinematics.compute_tool_pose(q) @ self._X_TF @ self._X_MC

    def _compute_visibility_mask(self, robot: Robot, X_WC: Pose) -> NDArray[np.bool_]:
        """Return the mask `(H, W)` of the pixels that no hull around arm, tool or held object occludes."""
        width, height = self._size
        occluded = np.zeros((height, width), dtype=np.uint8)
        if self._hulls is None:
            return occluded == 0
        q = robot.arm.q
        self._hulls.draw(occluded, q, self.matrix, X_WC)
        X_WT = self._kinematics.compute_tool_pose(q)
        X_WF = X_WT @ self._X_TF
        parts = [([X_WF.position, X_WT.position], TOOL_SPHERE_RADIUS)]
        if robot.tool.holding:
            load_end = X_WT.apply(np.array([0.0, 0.0, self._load_height]))
            parts.append(([X_WT.position, load_end], self._load_radius))
        for points, radius in parts:
            for start, end in itertools.pairwise(points):
                centres = X_WC.inverse().apply(np.linspace(start, end, SPHERES_PER_SEGMENT))
                for x, y, z in (centres @ self.matrix.T).tolist():
                    # A sphere behind the camera is invisible.
                    if z <= radius:
                        continue
                    column = round(x / z)
                    row = round(y / z)
                    # OpenCV cannot draw circles with very large coordinates.
                    if abs(column) <= 4 * width and abs(row) <= 4 * height:
                        size = max(1, round(self.matrix[0, 0] * radius / z))
                        cv2.circle(occluded, (column, row), size, 1, -1)
        for corners in map(X_WT.apply, self._tool_corners):
            draw_hull(occluded, corners, self.matrix, X_WC)
        return occluded == 0


def encode_image(image: CameraImage) -> dict[str, Any]:
    """Return size, time and visible pixels of an image; the journal does not contain the colours.

    Raises:
        WrongImage: A camera returned something else than a valid image.
    """
    if problem := _describe_invalid_image(image):
        raise WrongImage(f"a camera returned {problem}; `CameraImage` in executive.cell.devices is required")
    visible = None if image.visible is None else _encode_mask(image.visible)
    return {"size": list(image.colour.shape[:2]), "stamp": image.stamp, "visible": visible}


def _describe_invalid_image(image: Any) -> str:
    if not isinstance(image, CameraImage):
        return f"a {type(image).__name__}"
    for name, dtype in {"colour": np.uint8, "depth": np.floating, "visible": np.bool_}.items():
        array = getattr(image, name)
        if array is None and name != "colour":
            continue
        if not isinstance(array, np.ndarray):
            return f"{type(array).__name__} as {name}"
        size = np.shape(image.colour)[:2]
        if array.shape != ((*size, 3) if name == "colour" else size) or not np.issubdtype(array.dtype, dtype):
            return f"an array {array.shape} of {array.dtype} as {name}"
    is_time = isinstance(image.stamp, int | float) and math.isfinite(image.stamp)
    return "" if is_time else f"the stamp {image.stamp!r}"


def decode_image(value: Any) -> CameraImage:
    """Return a black image of the size and the time that `encode_image` encoded, without depth."""
    height, width = value["size"]
    if not 0 < height * width <= MAX_PIXELS:
        raise ValueError(f"an image of {height} x {width} pixels")
    visible = None if value["visible"] is None else _decode_mask(value["visible"], height, width)
    return CameraImage(np.zeros((height, width, 3), np.uint8), None, value["stamp"], visible)


def _encode_mask(mask: NDArray[np.bool_]) -> str:
    """Return a mask as compressed bits in base64; "" if all pixels are True, to keep the journal short."""
    if mask.all():
        return ""
    return base64.b64encode(zlib.compress(np.packbits(mask).tobytes())).decode("ascii")


def _decode_mask(text: str, height: int, width: int) -> NDArray[np.bool_]:
    """Return the mask `(height, width)` that `_encode_mask` encoded."""
    if not text:
        return np.ones((height, width), np.bool_)
    packed_bits = np.frombuffer(zlib.decompress(base64.b64decode(text)), np.uint8)
    return np.unpackbits(packed_bits, count=height * width).reshape(height, width).astype(np.bool_)
