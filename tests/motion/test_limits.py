from __future__ import annotations

import numpy as np

from executive.motion.limits import JointLimits


def test_limits_are_the_cell_files_in_radians(config, limits: JointLimits) -> None:
    assert np.allclose(np.degrees(limits.position), [170, 120, 170, 120, 170, 120, 175])
    assert np.allclose(np.degrees(limits.velocity), [85, 85, 100, 75, 130, 135, 135])
    assert np.allclose(limits.acceleration, config.arm.limits.acceleration)
    assert np.all(limits.stop_acceleration > limits.acceleration)
    assert np.all(limits.stop_jerk > limits.jerk)
