"""What the simulated arm hides from its camera, from joint positions and kinematics alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from executive.cell_config import CellConfig
from executive.geometry import Array, Pose
from executive.motion.kinematics import Kinematics
from executive.sim.arm import SimArm
from executive.vision.visibility import hidden, outline


class ArmShadow:
    """Tells which pixels show the scene and whether the whole workspace is among them."""

    def __init__(self, arm: SimArm, kinematics: Kinematics, config: CellConfig) -> None:
        self._arm = arm
        self._kinematics = kinematics
        top = max(kind.height for kind in config.objects.values())
        self._corners = np.array(
            [(x, y, z) for x in config.table.x for y in config.table.y for z in (0.0, top)]
        )

    def visible(self, matrix: Array, X_WC: Pose, size: tuple[int, int]) -> NDArray[np.bool_]:
        """Return `(H, W)` bool: True where the arm cannot be in front of the scene."""
        q = self._arm.q
        flange = self._kinematics.flange(q).position
        joints = [np.zeros(3), *(frame.position for frame in self._kinematics.joint_frames(q)), flange]
        return ~hidden(joints, [flange, self._kinematics.forward(q).position], matrix, X_WC, size)

    def sees_table(self, matrix: Array, X_WC: Pose, size: tuple[int, int]) -> bool:
        """Tell whether the whole workspace is in view and the arm not in front of it."""
        table = outline(self._corners, matrix, X_WC, size)
        return table is not None and bool(np.all(self.visible(matrix, X_WC, size)[table]))
