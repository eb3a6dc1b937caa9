"""Minimum times of descent, transport and detection in a simulated cell, from the limits of the joints."""

from __future__ import annotations

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.layout import build_bin, compute_max_pile_height
from executive.cells.min_times import CellMinTimes
from executive.cells.sim.tool import TOUCH_DISTANCE
from executive.errors import Unreachable
from executive.geometry import Array, make_tool_down_pose
from executive.motion.arms import build_kinematics
from executive.motion.joints import JointLimits, compute_min_time

REDUNDANCY_ANGLE_STEP = np.radians(20.0)
"""Difference between neighbouring samples of the redundancy angle [rad]."""
SAFETY_FACTOR = 0.8
"""Factor on the minimum transport time of the samples, because other heights and angles may be faster."""


class SimMinTimes(CellMinTimes):
    """Lower bounds of motion times for any planner; implements `executive.cell.protocols.MinTimes`.

    A transport begins at rest on an object and ends at rest over the bin. On any path, each joint needs at
    least the time of a rest-to-rest motion of this joint. The bound is the minimum over all pairs of first
    and last configurations; the last joint is ignored, because the yaw of the tool is arbitrary.

    Args:
        config: The cell file.
    """

    def __init__(self, config: CellConfig) -> None:
        self._pile_height = compute_max_pile_height(config)
        min_height = min(model.height for model in config.objects.values())
        super().__init__(config, TOUCH_DISTANCE, self._pile_height - min_height)
        self._limits = JointLimits.from_config(config.arm.limits)
        self._kinematics = build_kinematics(config)

    def _compute_min_transport_time(self, bin: str) -> float:
        slots = build_bin(bin, self._config.bins[bin]).slots
        low, high = np.transpose([self._config.table.x, self._config.table.y])
        starts = np.clip(slots, low, high), np.broadcast_to(self._config.safe_place[:2], slots.shape)
        try:
            return SAFETY_FACTOR * min(self._compute_min_time(positions, slots) for positions in starts)
        except Unreachable:
            return 0.0

    def _compute_min_time(self, positions: Array, slots: Array) -> float:
        """Return the minimum time [s] from `positions[i]` to `slots[i]` `(2,)` [m] for the nearest pair i."""
        nearest_row = np.argmin(np.linalg.norm(positions - slots, axis=1))
        starts, ends = (self._solve_configurations(points[nearest_row]) for points in (positions, slots))
        return float(compute_min_time(ends - starts[:, None], self._limits).min())

    def _solve_configurations(self, position: Array) -> Array:
        """Return joint configurations `(N, n)` [rad] with the tool over a position `(2,)` [m].

        The last joint is at 0, and the tool is at the height of the highest pile of objects.

        Raises:
            Unreachable: No joint configuration is within the limits.
        """
        pose = make_tool_down_pose(np.array([*position, self._pile_height]))
        qs = self._kinematics.solve_all(pose, np.zeros(self._limits.joint_count), REDUNDANCY_ANGLE_STEP).qs
        qs[:, -1] = 0.0
        valid_qs = qs[self._limits.position.contains(qs)]
        if not len(valid_qs):
            raise Unreachable("no configuration of the arm is inside its joint limits")
        return valid_qs
