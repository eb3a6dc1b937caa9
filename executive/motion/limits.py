"""What the joints of the arm may do, as arrays in SI units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from executive.cell_config import LimitsConfig
from executive.geometry import Array


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Joint limits, each of shape `(7,)`.

    Attributes:
        position: Largest angle to either side [rad].
        velocity: [rad/s].
        acceleration: [rad/s²].
        jerk: [rad/s³].
        stop_acceleration: Largest acceleration while braking [rad/s²].
        stop_jerk: Largest jerk while braking [rad/s³].
    """

    position: Array
    velocity: Array
    acceleration: Array
    jerk: Array
    stop_acceleration: Array
    stop_jerk: Array

    @staticmethod
    def of(config: LimitsConfig) -> JointLimits:
        """Return the limits of a cell file in radians."""
        return JointLimits(
            position=np.radians(config.position_deg),
            velocity=np.radians(config.velocity_deg),
            acceleration=np.array(config.acceleration),
            jerk=np.array(config.jerk),
            stop_acceleration=np.array(config.stop_acceleration),
            stop_jerk=np.array(config.stop_jerk),
        )
