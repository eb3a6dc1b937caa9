"""Occlusion of camera images by the simulated arm, from joint positions and kinematics."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell.config import CellConfig
from executive.cell.layout import compute_max_pile_height
from executive.cells.sim.world import World
from executive.geometry import Array, Pose
from executive.motion.arm_model import Kinematics
from executive.perception.camera_model import compute_hull_mask

MAX_LOAD_OFFSET = 0.015
"""Maximum distance of the centre of a held object from the axis of the suction cup [m]."""
TOOL_SPHERE_RADIUS = 0.02
"""Radius of the spheres that enclose the tool, including tube and fittings [m]."""
SPHERES_PER_SEGMENT = 9
"""Number of spheres that cover the segment between two points on the axis of a part of the arm."""

ArmPart = tuple[Sequence[Array], float]
"""Points `(3,)` [m] along a part of the arm, and the radius of the spheres that enclose the part [m]."""


class ArmOcclusion:
    """Occlusion of camera images by the arm, its tool and a held object.

    Args:
        world: The world with the arm.
        kinematics: Kinematics of the arm.
        config: The cell file.
        is_loaded: Returns True if the tool holds an object; the object is assumed to be of the largest class.
    """

    def __init__(
        self, world: World, kinematics: Kinematics, config: CellConfig, is_loaded: Callable[[], bool]
    ) -> None:
        self._world = world
        self._kinematics = kinematics
        self._is_loaded = is_loaded
        # T is the frame of the tool, F the frame of the flange.
        self._X_TF = Pose.of([0.0, 0.0, -config.tool.length])
        self._load_radius = max(model.radius for model in config.objects.values()) + MAX_LOAD_OFFSET
        self._load_height = config.max_object_height
        heights = (0.0, compute_max_pile_height(config))
        self._workspace_corners = np.array(list(itertools.product(config.table.x, config.table.y, heights)))

    def compute_visibility_mask(self, matrix: Array, X_WC: Pose, size: tuple[int, int]) -> NDArray[np.bool_]:
        """Return a mask `(H, W)` of the visible pixels.

        `matrix` is the camera matrix `(3, 3)` [pixel], and `size` is width and height of the image [pixel].
        """
        q = self._world.get_joint_positions()
        X_WT = self._kinematics.compute_tool_pose(q)
        X_WF = X_WT @ self._X_TF
        joint_frames = self._kinematics.compute_joint_frames(q)
        joints = [np.zeros(3), *(frame.position for frame in joint_frames), X_WF.position]
        tool_axis = [X_WF.position, X_WT.position]
        parts: list[ArmPart] = [(joints, self._world.robot.link_radius), (tool_axis, TOOL_SPHERE_RADIUS)]
        if self._is_loaded():
            load_end = X_WT.apply(np.array([0.0, 0.0, self._load_height]))
            parts.append(([X_WT.position, load_end], self._load_radius))
        return ~_compute_occlusion_mask(parts, matrix, X_WC, size)

    def is_table_visible(self, matrix: Array, X_WC: Pose, size: tuple[int, int]) -> bool:
        """Return True if the workspace, up to the height of a pile, is in the image and not occluded."""
        mask = compute_hull_mask(self._workspace_corners, matrix, X_WC, size)
        return mask is not None and bool(np.all(self.compute_visibility_mask(matrix, X_WC, size)[mask]))


def _compute_occlusion_mask(
    parts: Sequence[ArmPart], matrix: Array, X_WC: Pose, size: tuple[int, int]
) -> NDArray[np.bool_]:
    """Return the mask `(H, W)` of the pixels that the arm may occlude: projections of its enclosing spheres.

    `parts` are the links, the tool and the held object. `matrix` is the camera matrix `(3, 3)` [pixel], and
    `size` is the width and height of the image [pixel].
    """
    mask = np.zeros((size[1], size[0]), dtype=np.uint8)
    for points, radius in parts:
        for start, end in itertools.pairwise(points):
            centres = X_WC.inverse().apply(np.linspace(start, end, SPHERES_PER_SEGMENT))
            for x, y, z in (centres @ matrix.T).tolist():
                # A sphere behind the camera is invisible. The link that carries a wrist camera has a sphere
                # around the camera, which would occlude the whole image.
                if z <= radius:
                    continue
                column, row = round(x / z), round(y / z)
                # OpenCV cannot draw circles with very large coordinates.
                if abs(column) <= 4 * size[0] and abs(row) <= 4 * size[1]:
                    cv2.circle(mask, (column, row), max(1, round(matrix[0, 0] * radius / z)), 1, -1)
    return mask.astype(bool)
