"""Minimum times in a simulated cell, from joint limits and inverse kinematics."""

from __future__ import annotations

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.layout import build_bin, compute_max_pile_height
from executive.cells.min_times import CellMinTimes
from executive.cells.sim.tool import TOUCH_DISTANCE
from executive.errors import Unreachable
from executive.geometry import Array, tool_down
from executive.motion.arms import build_kinematics
from executive.motion.limits import JointLimits, compute_min_time

ANGLE_SPACING = np.radians(20.0)
"""Step between sampled redundancy angles [rad]."""
SAFETY_FACTOR = 0.8
"""Share of the minimum time found for a carry; other branches and heights may take less time."""


class SimMinTimes(CellMinTimes):
    """Lower bounds of motion times for any planner; implements `executive.cell.protocols.MinTimes`.

    A carry begins at rest on an object and ends at rest over the bin. On any path, each joint needs at least
    the time of its rest-to-rest motion. The bound is the minimum over all branches; the last joint need
    not turn, because the yaw is arbitrary.

    Args:
        config: The cell file.
    """

    def __init__(self, config: CellConfig) -> None:
        self._highest = compute_max_pile_height(config)
        lowest = min(kind.height for kind in config.objects.values())
        super().__init__(config, TOUCH_DISTANCE, self._highest - lowest)
        self._limits = JointLimits.from_config(config.arm.limits)
        self._kinematics = build_kinematics(config)
        self._carries: dict[str, float] = {}

    def _compute_min_transport_time(self, bin: str) -> float:
        if bin not in self._carries:
            slots = build_bin(bin, self._config.bins[bin]).slots
            low, high = np.transpose([self._config.table.x, self._config.table.y])
            places = np.clip(slots, low, high), np.broadcast_to(self._config.safe_place[:2], slots.shape)
            try:
                self._carries[bin] = SAFETY_FACTOR * min(self._min_time(place, slots) for place in places)
            except Unreachable:
                self._carries[bin] = 0.0
        return self._carries[bin]

    def _min_time(self, places: Array, slots: Array) -> float:
        """Return the minimum time [s] for the nearest pair of `places` `(N, 2)` and `slots` `(N, 2)` [m]."""
        nearest = np.argmin(np.linalg.norm(places - slots, axis=1))
        starts, ends = (self._solve_postures(points[nearest], self._highest) for points in (places, slots))
        return float(compute_min_time(ends - starts[:, None], self._limits).min())

    def _solve_postures(self, place: Array, height: float) -> Array:
        """Return joint positions `(N, n)` [rad] with the tool at a place `(2,)` [m], the last joint at 0.

        Raises:
            Unreachable: No joint positions are within the limits.
        """
        pose = tool_down(np.array([*place, height]))
        found = self._kinematics.solve_all(pose, np.zeros(self._limits.joint_count), ANGLE_SPACING).qs
        found[:, -1] = 0.0
        inside = found[self._limits.position.contains(found)]
        if not len(inside):
            raise Unreachable("no configuration of the arm is inside its joint limits")
        return inside
