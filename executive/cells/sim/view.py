"""Occlusion of the scene by the simulated arm, from joint positions and kinematics."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import CellConfig
from executive.cell.layout import compute_max_pile_height
from executive.cells.sim.arm import SimArm
from executive.cells.sim.robot_models import ROBOT_MODELS
from executive.geometry import Array, Pose
from executive.motion.arm_model import Kinematics
from executive.perception.visibility import (
    TOOL_RADIUS,
    ArmPart,
    find_hidden_pixels,
    find_outline_pixels,
)

MAX_LOAD_OFFSET = 0.015
"""Largest distance of the centre of a held object from the axis of the cup [m]."""


class ArmShadow:
    """Pixels that the arm does not occlude, and visibility of the whole workspace.

    Args:
        arm: The arm.
        kinematics: Kinematics of the arm.
        config: The cell file.
        loaded: Returns True if the tool holds an object; the object then occludes as much as the largest.
    """

    def __init__(
        self,
        arm: SimArm,
        kinematics: Kinematics,
        config: CellConfig,
        loaded: Callable[[], bool] = lambda: False,
    ) -> None:
        self._arm = arm
        self._kinematics = kinematics
        self._loaded = loaded
        self._link_radius = ROBOT_MODELS[config.arm.urdf].link_radius
        self._load = max(kind.radius for kind in config.objects.values()) + MAX_LOAD_OFFSET
        self._top = max(kind.height for kind in config.objects.values())
        top = compute_max_pile_height(config)
        self._corners = np.array(
            [(x, y, z) for x in config.table.x for y in config.table.y for z in (0.0, top)]
        )

    def visible(self, matrix: Array, X_WC: Pose, size: tuple[int, int]) -> NDArray[np.bool_]:
        """Return a mask `(H, W)` of the pixels that the arm cannot occlude."""
        q = self._arm.q
        flange, X_WT = self._kinematics.compute_flange_pose(q).position, self._kinematics.compute_tool_pose(q)
        joints = [
            np.zeros(3),
            *(frame.position for frame in self._kinematics.compute_joint_frames(q)),
            flange,
        ]
        parts: list[ArmPart] = [(joints, self._link_radius), ([flange, X_WT.position], TOOL_RADIUS)]
        if self._loaded():
            parts.append(([X_WT.position, X_WT.apply(np.array([0.0, 0.0, self._top]))], self._load))
        return ~find_hidden_pixels(parts, matrix, X_WC, size)

    def sees_table(self, matrix: Array, X_WC: Pose, size: tuple[int, int]) -> bool:
        """Return True if the whole workspace is in view and the arm does not occlude it."""
        table = find_outline_pixels(self._corners, matrix, X_WC, size)
        return table is not None and bool(np.all(self.visible(matrix, X_WC, size)[table]))
