"""Minimum times in a simulated cell, from limits and inverse kinematics alone."""

from __future__ import annotations

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.layout import as_bin, pile_height
from executive.cells.least_times import CellLeastTimes
from executive.cells.sim.tool import TOUCH_DISTANCE
from executive.errors import Unreachable
from executive.geometry import Array, tool_down
from executive.motion.arms import build_kinematics
from executive.motion.limits import JointLimits, min_time

ANGLE_SPACING = np.radians(20.0)
"""Distance between the redundancy angles that are tried [rad]."""
SAFETY_FACTOR = 0.8
"""Share of the minimum time found for a carry; other configurations and heights may take less time."""


class SimLeastTimes(CellLeastTimes):
    """Bounds that hold however a motion is planned; implements `executive.cell.protocols.LeastTimes`.

    A carry begins at rest on an object and ends at rest over the bin: no joint makes its part of that sooner
    than from rest to rest, whatever the way between. The least over all configurations counts; the last joint
    need not turn, since any yaw will do.

    Args:
        config: The cell file.
    """

    def __init__(self, config: CellConfig) -> None:
        self._highest = pile_height(config)
        lowest = min(kind.height for kind in config.objects.values())
        super().__init__(config, TOUCH_DISTANCE, self._highest - lowest)
        self._limits = JointLimits.of(config.arm.limits)
        self._kinematics = build_kinematics(config)
        self._carries: dict[str, float] = {}

    def _min_carry_time(self, bin: str) -> float:
        if bin not in self._carries:
            slots = as_bin(bin, self._config.bins[bin]).slots
            low, high = np.transpose([self._config.table.x, self._config.table.y])
            places = np.clip(slots, low, high), np.broadcast_to(self._config.safe_place[:2], slots.shape)
            try:
                self._carries[bin] = SAFETY_FACTOR * min(self._shortest(place, slots) for place in places)
            except Unreachable:
                self._carries[bin] = 0.0
        return self._carries[bin]

    def _shortest(self, places: Array, slots: Array) -> float:
        """Return the time of the shortest of the ways from `places` `(N, 2)` to `slots` `(N, 2)` [m]."""
        nearest = np.argmin(np.linalg.norm(places - slots, axis=1))
        starts, ends = (self._postures(ways[nearest], self._highest) for ways in (places, slots))
        return float(min_time(ends - starts[:, None], self._limits).min())

    def _postures(self, place: Array, height: float) -> Array:
        """Return joint positions `(N, n)` [rad] with the tool at a place `(2,)` [m], the last joint at 0.

        Raises:
            Unreachable: There are none.
        """
        pose = tool_down(np.array([*place, height]))
        found = self._kinematics.solve_all(pose, np.zeros(self._limits.joint_count), ANGLE_SPACING).qs
        found[:, -1] = 0.0
        inside = found[self._limits.position.contains(found)]
        if not len(inside):
            raise Unreachable("no configuration of the arm is inside its joint limits")
        return inside
