"""What things take in the simulated cell at the very least, from limits and inverse kinematics alone."""

from __future__ import annotations

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.layout import as_bin, pile_height
from executive.cells.sim.tool import TOUCH
from executive.errors import Unreachable
from executive.geometry import Array, tool_down
from executive.motion.arms import build_kinematics
from executive.motion.limits import JointLimits, min_time

SPACING = np.radians(20.0)
"""Distance between the redundancy angles that are tried [rad]."""
SAFETY = 0.8
"""Share of the minimum time found for a carry; other configurations and heights may take less time."""


class SimLeastTimes:
    """Bounds that hold however a motion is planned; implements `executive.cell.protocols.LeastTimes`.

    A carry begins at rest on an object and ends at rest over the bin: no joint makes its part of that sooner
    than from rest to rest, whatever the way between. The least over all configurations counts; the last joint
    need not turn, since any yaw will do.

    Args:
        config: The cell file.
    """

    def __init__(self, config: CellConfig) -> None:
        self._config = config
        self._limits = JointLimits.of(config.arm.limits)
        self._kinematics = build_kinematics(config)
        self._highest = pile_height(config)
        self._carries: dict[str, float] = {}

    @property
    def descent(self) -> float:
        """The guarded last part of an approach, to the highest object where the lowest was expected [s]."""
        motion = self._config.motion
        lowest = min(kind.height for kind in self._config.objects.values())
        return max(0.0, motion.descent - (self._highest - lowest) - TOUCH) / motion.descent_speed

    def carry(self, bin: str | None) -> float:
        """From the nearest place where objects lie to over a bin, or over the nearest bin [s].

        0 for a bin that the cell does not have, and where the arm does not reach one of the two.
        """
        names = self._config.bins if bin is None else {bin} & set(self._config.bins)
        return min(map(self._carry, names), default=0.0)

    def answer(self, detector: str) -> float:
        """From a frame to the answer of a detector; "": the first [s]. 0 for one that the cell lacks."""
        detectors = self._config.detectors
        config = detectors.get(detector or next(iter(detectors)))
        return config.latency if config else 0.0

    def _carry(self, bin: str) -> float:
        if bin not in self._carries:
            slots = as_bin(bin, self._config.bins[bin]).slots
            low, high = np.transpose([self._config.table.x, self._config.table.y])
            places = np.clip(slots, low, high), np.broadcast_to(self._config.safe_place[:2], slots.shape)
            try:
                self._carries[bin] = SAFETY * min(self._shortest(place, slots) for place in places)
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
        found = self._kinematics.solve_all(pose, np.zeros(self._limits.joint_count), SPACING).qs
        found[:, -1] = 0.0
        inside = found[self._limits.position.contains(found)]
        if not len(inside):
            raise Unreachable("no configuration of the arm is inside its joint limits")
        return inside
